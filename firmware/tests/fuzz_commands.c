/* Any bytes to a running glove: it neither fails nor stops answering. With HS_RANDOM_DRIVER without
 * libFuzzer. */
#include "core/cobs.h"
#include "core/crc32.h"
#include "core/hand_layout.h"
#include "tests/bench.h"

#include <time.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

static struct hs_strip_layout strips[HS_STRIPS];
static struct hs_layout layout = {
    .device_id = 1, .hand = HS_LEFT, .name = "fuzz", .strips = strips};

/* As raw bytes, and as the payload of a frame whose checksum is right. */
static void feed(const uint8_t *data, size_t n)
{
    n = n < sizeof bench.to_glove ? n : sizeof bench.to_glove;
    memcpy(bench.to_glove, data, n);
    bench.written = n;
    bench.read = 0;
    bench_run(0.02 + 0.0005 * (double)(n / 64));
    const uint8_t zero = 0;
    memcpy(bench.to_glove, &zero, 1);
    bench.written = 1;
    bench.read = 0;
    bench_run(0.001);
    if (n > 0) {
        bench_command(data[0], data + 1, n - 1 < 1024 ? n - 1 : 1024);
    }
    bench_forget();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    static bool began;
    if (!began) {
        layout.count = hs_hand_layout("thumb,index,trunk_mag", HS_LEFT, &hs_lsm6dsv16x, strips);
        bench_power_up(&layout);
        began = true;
    }
    feed(data, n);
    bench_command(HS_PING, "12345678", 8);
    struct hs_frame frame;
    bench_run(0.002);
    CHECK(bench_find(HS_PONG, &frame) && memcmp(frame.payload, "12345678", 8) == 0);
    bench_forget();
    return 0;
}

#ifdef HS_RANDOM_DRIVER
int main(int count, char **words)
{
    const double seconds = count > 1 ? atof(words[1]) : 5;
    const clock_t began = clock();
    uint32_t state = 1;
    long inputs = 0;
    while ((double)(clock() - began) / CLOCKS_PER_SEC < seconds) {
        uint8_t data[512];
        const size_t n = (state >> 8) % sizeof data;
        for (size_t k = 0; k < n; k++) {
            state = state * 1664525u + 1013904223u;
            data[k] = (uint8_t)(state >> 24);
        }
        state = state * 1664525u + 1013904223u;
        data[0] = inputs % 2 == 0 ? (uint8_t)(0x80 + (state >> 20) % 12) : data[0];
        LLVMFuzzerTestOneInput(data, n);
        inputs++;
    }
    printf("%ld random inputs, no failure\n", inputs);
    return 0;
}
#endif
