/* The whole-hand glove on an emulated Cortex-M3. With HS_COUNT: how many instructions its loop
 * takes, with QEMU's -icount shift=0 (1 ns each). */
#include "boards/mps2-an385/mps2.h"
#include "boards/simulated/world.h"
#include "core/hand_layout.h"

static struct hs_glove glove;
static struct hs_strip_layout strips[HS_STRIPS];
static struct hs_layout layout = {
    .device_id = 0xA385, .hand = HS_LEFT, .name = "Handscope QEMU glove", .strips = strips};

#ifdef HS_COUNT
static void print(const char *what, uint64_t number)
{
    char line[96];
    size_t at = strlen(what), digits = 1;
    memcpy(line, what, at);
    for (uint64_t left = number; left >= 10; left /= 10) {
        digits++;
    }
    for (size_t k = digits; k-- > 0; number /= 10) {
        line[at + k] = (char)('0' + number % 10);
    }
    line[at + digits] = '\n';
    line[at + digits + 1] = 0;
    mps2_semihost(0x04, line);
}

static void start_samples(void)
{
    static uint8_t payload[1];
    const struct hs_frame frame = {HS_START, 0, payload, 0};
    hs_glove_execute(&glove, &frame);
}

#define IDLE 1200 /* instructions: polls in which nothing is due take about 500 */

/* A second of samples once all strips run. */
static void count(void)
{
    static const uint32_t done[2] = {0x20026, 0};
    uint64_t began = 0, spent = 0, longest = 0;
    while (began == 0 || board_now() - began < HS_SECOND) {
        const uint64_t before = board_now(), bus = mps2_bus_time;
        hs_glove_poll(&glove);
        const uint64_t own = board_now() - before - (mps2_bus_time - bus);
        if (began != 0) {
            spent += own > IDLE ? own : 0;
            longest = own > longest ? own : longest;
        } else if (board_now() > 600ull * HS_MILLISECOND) {
            start_samples();
            began = board_now();
        }
    }
    print("longest poll, instructions: ", longest);
    print("work in a second of 17 sensors at 200 Hz, instructions: ", spent);
    print("a sweep of all sensors every 5 ms, instructions: ", spent / 200);
    mps2_semihost(0x18, (const void *)(uintptr_t)done[0]);
}
#endif

/* The number at the end of the emulator's command line (-semihosting-config arg=), 0: none. */
static uint32_t last_number(void)
{
    static char line[128];
    const struct {
        char *buffer;
        uint32_t size;
    } block = {line, sizeof line};
    uint32_t number = 0;
    if (mps2_semihost(0x15, &block) != 0) {
        return 0;
    }
    for (const char *c = line; *c != 0; c++) {
        number = *c >= '0' && *c <= '9' ? 10 * number + (uint32_t)(*c - '0') : 0;
    }
    return number;
}

int main(void)
{
#ifdef HS_COUNT
    mps2_is_counted = true;
#endif
    mps2_start();
    layout.count = hs_hand_layout(HS_WHOLE_HAND, layout.hand, &hs_icm42688p, strips);
    sim_start(&layout, 1, true);
    if (hs_glove_start(&glove, &layout) != NULL) {
        return 1;
    }
#ifdef HS_COUNT
    count();
#endif
    const double samples = last_number();
    for (;;) {
        hs_glove_poll(&glove);
        sim_follow(&glove);
        sim_stop_after(&glove, samples);
        mps2_sleep();
    }
}
