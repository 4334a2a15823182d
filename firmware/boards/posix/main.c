/* The glove's core as a program: simulated chips behind the drivers, the wire protocol on a TCP
 * port or a pseudo-terminal. */
#define _XOPEN_SOURCE 600
#include "boards/simulated/world.h"
#include "core/hand_layout.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

static struct hs_glove glove;
static struct hs_strip_layout strips[HS_STRIPS];
static struct hs_layout layout = {
    .device_id = 0x5C09E, .hand = HS_LEFT, .name = "Handscope posix glove", .strips = strips};
static int listener = -1, host = -1, host_side = -1;
static const char *link_path;
static volatile sig_atomic_t stopped;

struct pull {
    uint8_t slot;
    double from, to;
};
static struct wanted {
    const char *pty, *strips;
    int port;
    double seconds;
    double samples; /* s of samples after which they end; 0: never */
    bool pausing, full;
    const struct hs_driver *chip;
    uint32_t seed;
    struct pull pulls[8];
    int pull_count;
} options = {.strips = HS_WHOLE_HAND, .port = -1, .chip = &hs_icm42688p, .seed = 1};

#define LONGEST_PASS (50 * HS_MILLISECOND) /* of a clock that pauses with the program */
static bool unsent; /* the host has not taken all yet: a clock that pauses waits for it, too */

uint64_t board_now(void)
{
    static uint64_t began, before;
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    const uint64_t now = (uint64_t)t.tv_sec * HS_SECOND + (uint64_t)t.tv_nsec;
    began = began == 0 ? now - HS_MILLISECOND : began;
    const uint64_t longest = unsent ? 0 : LONGEST_PASS;
    if (options.pausing && before != 0 && now - before > longest) {
        began += now - before - longest;
    }
    before = now;
    return now - began;
}

void board_wait(uint32_t microseconds)
{
    const struct timespec t = {0, (long)microseconds * 1000};
    nanosleep(&t, NULL);
}

bool board_transfer(const struct hs_bus *bus, const uint8_t *out, size_t n_out, uint8_t *in,
                    size_t n_in)
{
    return sim_transfer(bus, out, n_out, in, n_in);
}

size_t board_send(const uint8_t *bytes, size_t n)
{
    const ssize_t sent = host < 0 ? -1 : write(host, bytes, n);
    const size_t taken = sent < 0 ? 0 : (size_t)sent;
    unsent = host >= 0 && taken < n;
    return taken;
}

static void hang_up(void)
{
    unsent = false; /* nobody is waited for */
    hs_glove_hang_up(&glove);
    if (listener >= 0 && host >= 0) {
        close(host);
        host = -1;
    }
}

size_t board_receive(uint8_t *bytes, size_t n)
{
    const ssize_t got = host < 0 ? -1 : read(host, bytes, n);
    if (got == 0 || (got < 0 && host >= 0 && errno != EAGAIN && errno != EINTR)) {
        hang_up();
    }
    return got < 0 ? 0 : (size_t)got;
}

bool board_flash_read(uint8_t page, uint8_t *bytes, size_t n)
{
    (void)page, (void)bytes, (void)n;
    return false;
}
bool board_flash_write(uint8_t page, const uint8_t *bytes, size_t n)
{
    (void)page, (void)bytes, (void)n;
    return false;
}
void board_feed_watchdog(void) {}
bool board_supply_is_low(void) { return false; }
uint8_t board_battery(void) { return 255; }

uint32_t board_random(void)
{
    static FILE *source;
    uint32_t value = 0;
    source = source != NULL ? source : fopen("/dev/urandom", "rb");
    if (source == NULL || fread(&value, sizeof value, 1, source) != 1) {
        value = (uint32_t)(time(NULL) ^ getpid()) * 2654435761u + (uint32_t)rand();
    }
    return value;
}

bool board_show_cue(const char *task)
{
    fprintf(stderr, "cue: %s\n", task);
    return true;
}

static void fail(const char *what)
{
    fprintf(stderr, "glove: %s\n", what);
    exit(2);
}

static void on_signal(int number)
{
    (void)number;
    stopped = 1;
}

static void listen_at(int port)
{
    struct sockaddr_in address = {.sin_family = AF_INET,
                                  .sin_port = htons((uint16_t)port),
                                  .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof address;
    const int yes = 1;
    listener = socket(AF_INET, SOCK_STREAM, 0);
    setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (listener < 0 || bind(listener, (struct sockaddr *)&address, size) != 0 ||
        listen(listener, 1) != 0) {
        fail("the port cannot be listened at; is another glove there?");
    }
    fcntl(listener, F_SETFL, O_NONBLOCK);
    getsockname(listener, (struct sockaddr *)&address, &size);
    printf("socket://127.0.0.1:%d\n", ntohs(address.sin_port));
}

static void open_terminal(const char *path)
{
    struct termios raw;
    host = posix_openpt(O_RDWR | O_NOCTTY);
    if (host < 0 || grantpt(host) != 0 || unlockpt(host) != 0) {
        fail("there is no pseudo-terminal on this system; use --tcp");
    }
    host_side = open(ptsname(host), O_RDWR | O_NOCTTY); /* keeps the line raw */
    tcgetattr(host_side, &raw);
    raw.c_iflag = raw.c_oflag = raw.c_lflag = 0;
    raw.c_cflag = CS8 | CREAD | CLOCAL;
    tcsetattr(host_side, TCSANOW, &raw);
    close(host_side);
    fcntl(host, F_SETFL, O_NONBLOCK);
    unlink(path);
    if (symlink(ptsname(host), path) != 0) {
        fail("the path of --pty cannot be made a link to the pseudo-terminal");
    }
    link_path = path;
    printf("%s\n", path);
}

static void accept_host(void)
{
    const int yes = 1, caller = listener >= 0 && host < 0 ? accept(listener, NULL, NULL) : -1;
    if (caller >= 0) {
        host = caller;
        fcntl(host, F_SETFL, O_NONBLOCK);
        setsockopt(host, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    }
}

/* On a pseudo-terminal: nobody has it open. */
static bool is_alone(void)
{
    struct pollfd end = {host, POLLIN, 0};
    return listener < 0 && poll(&end, 1, 0) > 0 && (end.revents & POLLHUP) != 0;
}

static double number(const char *word, double least, double most, const char *refusal)
{
    char *end;
    const double value = strtod(word, &end);
    if (end == word || *end != 0 || !(value >= least && value <= most)) {
        fail(refusal);
    }
    return value;
}

/* SLOT@FROM-TO: a strip that is pulled for a while, s after the start of the program. */
static void parse_pull(const char *word)
{
    unsigned slot = 0;
    struct pull pull;
    if (options.pull_count == 8 || sscanf(word, "%u@%lf-%lf", &slot, &pull.from, &pull.to) != 3) {
        fail("--pull takes SLOT@FROM-TO, at most eight times");
    }
    pull.slot = (uint8_t)slot;
    options.pulls[options.pull_count++] = pull;
}

static void parse(int count, char **words)
{
    for (int k = 1; k < count; k += 2) {
        const char *name = words[k], *value = k + 1 < count ? words[k + 1] : "";
        if (strcmp(name, "--help") == 0) {
            puts("glove --tcp PORT | --pty PATH  [--rate HZ] [--mag-rate HZ] [--strips NAME,...] "
                 "[--hand left|right] [--chip icm42688p|lsm6dsv16x]\n"
                 "      [--seconds S] [--samples S] [--clock real|pausing] [--seed N] [--pull "
                 "SLOT@FROM-TO] [--memory empty|full]\n"
                 "A glove with simulated sensors: hand, thumb, index, middle, ring, little, "
                 "forearm, trunk, trunk_mag. Port 0: any that is free.");
            exit(0);
        } else if (strcmp(name, "--tcp") == 0) {
            options.port = (int)number(value, 0, 65535, "--tcp takes a port of 0 to 65535");
        } else if (strcmp(name, "--pty") == 0) {
            options.pty = value;
        } else if (strcmp(name, "--rate") == 0) {
            layout.rate = number(value, 1, 1000, "--rate takes 1 to 1000 Hz");
        } else if (strcmp(name, "--mag-rate") == 0) {
            layout.mag_rate = number(value, 1, 100, "--mag-rate takes 1 to 100 Hz");
        } else if (strcmp(name, "--strips") == 0) {
            options.strips = value;
        } else if (strcmp(name, "--hand") == 0) {
            layout.hand = strcmp(value, "right") == 0 ? HS_RIGHT : HS_LEFT;
        } else if (strcmp(name, "--chip") == 0) {
            options.chip = strcmp(value, "lsm6dsv16x") == 0 ? &hs_lsm6dsv16x : &hs_icm42688p;
        } else if (strcmp(name, "--seconds") == 0) {
            options.seconds = number(value, 0, 1e9, "--seconds takes a number");
        } else if (strcmp(name, "--samples") == 0) {
            options.samples = number(value, 0, 1e9, "--samples takes a number of seconds");
        } else if (strcmp(name, "--clock") == 0) {
            options.pausing = strcmp(value, "pausing") == 0;
        } else if (strcmp(name, "--seed") == 0) {
            options.seed = (uint32_t)number(value, 0, 4294967295.0, "--seed takes a whole number");
        } else if (strcmp(name, "--memory") == 0) {
            options.full = strcmp(value, "full") == 0;
        } else if (strcmp(name, "--pull") == 0) {
            parse_pull(value);
        } else {
            fail("unknown option; see --help");
        }
    }
    if ((options.port < 0) == (options.pty == NULL)) {
        fail("say --tcp PORT or --pty PATH; see --help");
    }
}

static void pull_and_plug(double t)
{
    for (int k = 0; k < options.pull_count; k++) {
        sim_plug(options.pulls[k].slot, t < options.pulls[k].from || t >= options.pulls[k].to);
    }
}

static struct stamps {
    double sum, squares, worst;
    uint32_t n;
} stamps;

/* How far a reading's time is from when the simulated chip measured it. */
static void compare_stamps(void)
{
    static uint64_t before[HS_SENSORS];
    for (int k = 0; glove.running && k < HS_SENSORS; k++) {
        const struct hs_sensor *sensor = &glove.sensors[k];
        const struct sim_chip *chip = sensor->phase == HS_RUNNING && sensor->driver->has_clock
                                          ? sim_chip_at(sensor->bus.slot, sensor->bus.select)
                                          : NULL;
        if (chip == NULL || sensor->resampler.newest == before[k] || sensor->readings < 2000 ||
            sim_period(chip) == 0) {
            continue;
        }
        const int64_t period = (int64_t)sim_period(chip);
        const int64_t late =
            ((int64_t)(sensor->resampler.newest - chip->next) % period + period + period / 2) %
                period -
            period / 2;
        before[k] = sensor->resampler.newest;
        stamps.sum += (double)late * 1e-3;
        stamps.squares += (double)late * (double)late * 1e-6;
        stamps.worst =
            stamps.worst > (double)llabs(late) * 1e-3 ? stamps.worst : (double)llabs(late) * 1e-3;
        stamps.n++;
    }
}

static void print_true_rates(void)
{
    if (stamps.n > 0) {
        const double mean = stamps.sum / stamps.n;
        fprintf(stderr, "time stamps: %u compared, mean %.1f us, sd %.1f us, worst %.1f us\n",
                stamps.n, mean, sqrt(stamps.squares / stamps.n - mean * mean), stamps.worst);
    }
    for (uint8_t s = 0; s < glove.count; s++) {
        const struct hs_strip *strip = &glove.strips[s];
        for (uint8_t k = 0; strip->streams[0].driver != NULL && k < strip->count; k++) {
            const struct hs_sensor *sensor = &strip->streams[0].sensors[k];
            const float nominal = sensor->setting.hz,
                        error = 1e6f * (hs_sensor_true_rate(sensor) / nominal - 1);
            const struct sim_chip *chip = sim_chip_at(sensor->bus.slot, sensor->bus.select);
            fprintf(stderr,
                    "slot %d sensor %d: %.0f Hz nominal, measured %+.1f ppm, true %+d ppm, lost in "
                    "FIFO %u\n",
                    sensor->bus.slot, k, nominal, error, chip->error_ppm, chip->lost);
        }
    }
}

int main(int count, char **words)
{
    signal(SIGPIPE, SIG_IGN);
    signal(SIGTERM, on_signal);
    signal(SIGINT, on_signal);
    parse(count, words);
    layout.count = hs_hand_layout(options.strips, layout.hand, options.chip, strips);
    if (layout.count == 0) {
        fail("--strips names a strip that is not known; see --help");
    }
    sim_start(&layout, options.seed, true);
    sim.supply = options.full ? 0 : sim.supply;
    const char *refusal = hs_glove_start(&glove, &layout);
    if (refusal != NULL) {
        fail(refusal);
    }
    if (options.pty != NULL) {
        open_terminal(options.pty);
    } else {
        listen_at(options.port);
    }
    fflush(stdout);
    const uint64_t began = board_now();
    while (!stopped && (options.seconds <= 0 || board_now() - began < options.seconds * 1e9)) {
        accept_host();
        pull_and_plug((double)(board_now() - began) * 1e-9);
        if (is_alone() && glove.running) {
            hang_up();
        }
        hs_glove_poll(&glove);
        sim_follow(&glove);
        sim_stop_after(&glove, options.samples);
        compare_stamps();
        board_wait(500);
    }
    if (link_path != NULL) {
        unlink(link_path);
    }
    print_true_rates();
    return 0;
}
