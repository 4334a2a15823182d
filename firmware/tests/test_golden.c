/* Frames that Python's encoder wrote (golden_frames.txt) and this one's are the same to the byte.
 * With --print: all of the glove's, as in that file. */
#include "tests/bench.h"

static struct hs_outbox outbox;
static struct hs_frame_reader reader;
static struct hs_calibration calibration;

static const uint8_t points[3] = {5, 6, 7}, magnetometers[2] = {23, 24};
static const float mounting[4] = {0.5f, -0.5f, 0.5f, -0.5f},
                   places[2][3] = {{0, 0.25f, 0.5f}, {1, 1.25f, 1.5f}};

static void write_samples(struct hs_writer *w)
{
    const struct hs_burst head = {4, 4294967295u, 1ull << 40, (1ull << 40) + 5, 2};
    hs_write_burst(w, &head);
    for (unsigned k = 0; k < 72; k++) {
        hs_put_uint(w, k, 1);
    }
}

static void write_plate(struct hs_writer *w)
{
    const float nan = 0.0f;
    struct hs_plate plate = {0.5f, nan, {0, 0, 0.75f}, {0.5f, 0, 0}, 2, magnetometers, places};
    const uint32_t bits = 0x7fc00000u; /* the dip is not known */
    memcpy(&plate.dip, &bits, sizeof bits);
    hs_write_plate(w, &plate);
}

/* The glove's message of this name; false where there is none. */
static bool write_message(const char *name)
{
    static const char *const pairs[] = {"task_name", "tapping", "side", "left", NULL};
    const struct hs_identity identity = {0x5C09E, 0x12345678, HS_LEFT, "Test glove",
                                         "1.0 \xc3\xa9"};
    const struct hs_stream_info info = {
        4, 2, 0, HS_GYR | HS_ACC, HS_INT16, 200.5, {0.001953125f, 0.0078125f}, {35.0f, 156.5f}};
    static const char *const names[] = {"identity", "strip", "stream_info", "samples", "status",
                                        "reply",    "pong",  "calibration", "mark",    "plate"};
    size_t type = 0;
    while (type < 10 &&
           strcmp(names[type], strcmp(name, "strip_pulled") == 0 ? "strip" : name) != 0) {
        type++;
    }
    if (type == 10) {
        return false;
    }
    struct hs_writer *w = hs_outbox_begin(&outbox, (uint8_t)(type + 1));
    switch (type + 1) {
    case HS_IDENTITY: hs_write_identity(w, &identity); break;
    case HS_STRIP:
        hs_write_strip(w, 2, strcmp(name, "strip") == 0, 0xA0B0C0D0E0F00102u, 3, points,
                       strcmp(name, "strip") == 0 ? mounting : NULL);
        break;
    case HS_STREAM_INFO: hs_write_stream_info(w, &info); break;
    case HS_SAMPLES: write_samples(w); break;
    case HS_STATUS: hs_write_status(w, 123456789012345u, 7, 255, 31.5f); break;
    case HS_REPLY: hs_write_reply(w, 0x82, HS_BAD_ARGUMENT, "no"); break;
    case HS_PONG: hs_write_pong(w, UINT64_MAX, 1ull << 33); break;
    case HS_CALIBRATION: hs_write_calibration(w, 2, 1, &calibration); break;
    case HS_MARK: hs_write_mark(w, 1ull << 40, 1ull << 32, "task", pairs); break;
    default: write_plate(w); break;
    }
    CHECK(hs_outbox_end(&outbox));
    return true;
}

static void check_command(const char *name, const struct hs_frame *frame)
{
    struct hs_command c;
    CHECK(hs_read_command(frame, &c) == HS_DONE);
    if (strcmp(name, "configure") == 0) {
        const struct hs_configure *k = &c.of.configure;
        CHECK(k->slot == 255 && k->rate == 119.5 && k->mag_rate == 50 && k->gyr_range == 8.5f &&
              k->acc_range == 40 && k->format == HS_FLOAT32);
    } else if (strcmp(name, "ping") == 0) {
        CHECK(c.of.token == 0x0102030405060708u);
    } else if (strcmp(name, "cue") == 0) {
        CHECK(strcmp(c.of.task, "tapping") == 0);
    } else if (strcmp(name, "read_calibration") == 0) {
        CHECK(c.of.slot == 2);
    } else if (strcmp(name, "write_calibration") == 0) {
        CHECK(c.of.write.slot == 2 && c.of.write.sensor == 1 &&
              memcmp(&c.of.write.calibration, &calibration, sizeof calibration) == 0);
    } else {
        CHECK(strcmp(name, "identify") == 0 || strcmp(name, "start") == 0 ||
              strcmp(name, "stop") == 0);
    }
}

static size_t take(uint8_t *out)
{
    const uint8_t *bytes;
    size_t n, all = 0;
    while ((n = hs_outbox_peek(&outbox, &bytes)) > 0) {
        memcpy(out + all, bytes, n);
        hs_outbox_drop(&outbox, n);
        all += n;
    }
    return all;
}

static void compare(const char *name, const uint8_t *bytes, size_t n, bool print)
{
    static uint8_t ours[HS_FRAME];
    struct hs_frame frame;
    if (write_message(name)) {
        const size_t m = take(ours);
        if (print) {
            printf("%s ", name);
            for (size_t k = 0; k < m; k++) {
                printf("%02x%s", ours[k], k + 1 < m ? "" : "\n");
            }
        }
        CHECK(print || (m == n && memcmp(ours, bytes, n) == 0));
        return;
    }
    bool complete = false;
    for (size_t k = 0; k < n; k++) {
        complete = hs_frame_reader_push(&reader, bytes[k], &frame) || complete;
    }
    CHECK(complete);
    check_command(name, &frame);
}

int main(int count, char **words)
{
    const bool print = count > 1 && strcmp(words[1], "--print") == 0;
    static char name[64], hex[8192];
    static uint8_t bytes[4096];
    int frames = 0;
    FILE *file = fopen("tests/golden_frames.txt", "r");
    CHECK(file != NULL);
    for (int k = 0; k < 27; k++) {
        calibration.matrix[k] = 0.25f * (float)k;
        calibration.bias[k % 9] = 0.5f * (float)(k % 9) - 1;
    }
    for (; fscanf(file, "%63s %8191s", name, hex) == 2; frames++) {
        const size_t n = strlen(hex) / 2;
        for (size_t k = 0; k < n; k++) {
            unsigned byte;
            CHECK(sscanf(hex + 2 * k, "%2x", &byte) == 1);
            bytes[k] = (uint8_t)byte;
        }
        compare(name, bytes, n, print);
    }
    fclose(file);
    CHECK(frames == 19);
    if (!print) {
        PASSED();
    }
    return 0;
}
