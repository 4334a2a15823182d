#include "tests/bench.h"

struct bench bench;
struct hs_glove bench_glove;
static struct hs_frame_reader reader;

uint64_t board_now(void) { return bench.now; }
void board_wait(uint32_t microseconds) { bench.now += (uint64_t)microseconds * 1000; }
void board_feed_watchdog(void) {}
bool board_supply_is_low(void) { return bench.supply_low; }
uint8_t board_battery(void) { return 80; }
bool board_show_cue(const char *task) { return strcmp(task, "tapping") == 0; }

bool board_transfer(const struct hs_bus *bus, const uint8_t *out, size_t n_out, uint8_t *in,
                    size_t n_in)
{
    bench.now += bench.bus_ns * (1 + n_out + n_in);
    return sim_transfer(bus, out, n_out, in, n_in);
}

size_t board_send(const uint8_t *bytes, size_t n)
{
    n = n < bench.room ? n : bench.room;
    n = n < BENCH_WIRE - bench.sent ? n : BENCH_WIRE - bench.sent;
    memcpy(bench.to_host + bench.sent, bytes, n);
    bench.sent += n;
    bench.room -= n;
    return n;
}

size_t board_receive(uint8_t *bytes, size_t n)
{
    n = n < bench.written - bench.read ? n : bench.written - bench.read;
    memcpy(bytes, bench.to_glove + bench.read, n);
    bench.read += n;
    return n;
}

bool board_flash_read(uint8_t page, uint8_t *bytes, size_t n)
{
    if (bench.has_flash) {
        memcpy(bytes, bench.flash[page], n);
    }
    return bench.has_flash;
}

bool board_flash_write(uint8_t page, const uint8_t *bytes, size_t n)
{
    if (!bench.has_flash || bench.flash_fails) {
        return false;
    }
    memset(bench.flash[page], 0xFF, HS_PAGE);
    memcpy(bench.flash[page], bytes, n);
    return true;
}

uint32_t board_random(void) { return sim_draw() << 8 ^ sim_draw(); }

void bench_clear(void)
{
    const int checks = bench.checks;
    memset(&bench, 0, sizeof bench);
    memset(&reader, 0, sizeof reader);
    bench.now = HS_SECOND;
    bench.room = BENCH_WIRE;
    bench.bus_ns = 2000; /* SPI at 4 MHz */
    bench.checks = checks;
}

void bench_run(double seconds)
{
    const uint64_t end = bench.now + (uint64_t)(seconds * 1e9);
    while (bench.now < end) {
        hs_glove_poll(&bench_glove);
        bench.now += HS_MILLISECOND / 2;
    }
}

void bench_power_up(const struct hs_layout *layout)
{
    bench_clear();
    sim_start(layout, 7, true);
    CHECK(hs_glove_start(&bench_glove, layout) == NULL);
    bench_run(1.0);
}

void bench_command(uint8_t type, const void *payload, size_t n)
{
    static struct hs_outbox encoder;
    const uint8_t *bytes;
    bench.written = bench.read = 0;
    hs_put(hs_outbox_begin(&encoder, type), payload, n);
    CHECK(hs_outbox_end(&encoder));
    while ((n = hs_outbox_peek(&encoder, &bytes)) > 0) {
        memcpy(bench.to_glove + bench.written, bytes, n);
        bench.written += n;
        hs_outbox_drop(&encoder, n);
    }
    while (bench.read < bench.written) {
        hs_glove_poll(&bench_glove);
    }
}

bool bench_next(struct hs_frame *frame)
{
    while (bench.taken < bench.sent) {
        if (hs_frame_reader_push(&reader, bench.to_host[bench.taken++], frame)) {
            return true;
        }
    }
    return false;
}

bool bench_find(uint8_t type, struct hs_frame *frame)
{
    while (bench_next(frame)) {
        if (frame->type == type) {
            return true;
        }
    }
    return false;
}

void bench_forget(void)
{
    struct hs_frame frame;
    while (bench_next(&frame)) {
    }
    bench.sent = bench.taken = 0;
    bench.room = BENCH_WIRE;
}

int bench_reply(uint8_t command)
{
    struct hs_frame frame;
    while (bench_find(HS_REPLY, &frame)) {
        if (frame.payload[0] == command) {
            return frame.payload[1];
        }
    }
    return -1;
}
