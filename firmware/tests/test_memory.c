/* A strip's memory: power cut at every byte, copies, what cannot be kept. */
#include "tests/bench.h"

static const struct hs_strip_layout strip = {
    .slot = 0, .count = 3, .points = {5, 6, 7}, .drivers = {&hs_icm42688p, NULL}};
static const struct hs_layout layout = {
    .device_id = 1, .hand = HS_LEFT, .name = "test", .strips = &strip, .count = 1};

static struct hs_strip_record record_of(float bias)
{
    struct hs_strip_record record = {.strip_id = 77, .n = 3, .points = {5, 6, 7}};
    for (int k = 0; k < 3; k++) {
        hs_identity_calibration(&record.calibration[k]);
        record.calibration[k].bias[k] = bias;
    }
    return record;
}

static bool is_same(const struct hs_strip_record *a, const struct hs_strip_record *b)
{
    return a->strip_id == b->strip_id && a->n == b->n &&
           memcmp(a->calibration, b->calibration, 3 * sizeof a->calibration[0]) == 0;
}

static void prepare(void)
{
    bench_clear();
    sim_start(&layout, 3, true);
}

static void test_an_empty_memory_has_no_record(void)
{
    struct hs_strip_memory memory;
    struct hs_strip_record found;
    prepare();
    CHECK(!hs_strip_memory_open(&memory, 0, &found) && memory.kind == HS_CHIP);
}

/* Whatever byte is the last that is written, the record before or the new one is read back whole.
 */
static void test_a_power_cut_at_every_byte_loses_nothing(void)
{
    struct hs_strip_memory memory;
    struct hs_strip_record found;
    const struct hs_strip_record first = record_of(1), second = record_of(2), third = record_of(3);
    int news = 0, olds = 0;
    for (int64_t cut = 0; cut < 470; cut++) {
        prepare();
        hs_strip_memory_open(&memory, 0, &found);
        CHECK(hs_strip_memory_write(&memory, &first) && hs_strip_memory_write(&memory, &second));
        sim.supply = cut;
        const bool written = hs_strip_memory_write(&memory, &third);
        sim.supply = -1;
        bench.now += HS_SECOND;
        CHECK(hs_strip_memory_open(&memory, 0, &found));
        const bool is_new = is_same(&found, &third);
        CHECK(is_new || is_same(&found, &second));
        CHECK(is_new || !written);
        CHECK(hs_strip_memory_write(&memory, &third) && hs_strip_memory_open(&memory, 0, &found) &&
              is_same(&found, &third));
        news += is_new ? 1 : 0;
        olds += is_new ? 0 : 1;
    }
    CHECK(news > 0 && olds > 400);
}

static void test_a_damaged_copy_is_passed_over(void)
{
    struct hs_strip_memory memory;
    struct hs_strip_record found;
    const struct hs_strip_record first = record_of(1), second = record_of(2);
    for (size_t at = 0; at < 458; at++) {
        prepare();
        hs_strip_memory_open(&memory, 0, &found);
        hs_strip_memory_write(&memory, &first);
        hs_strip_memory_write(&memory, &second);
        sim.memory[0].bytes[at + (memory.copy == 1 ? HS_PAGE : 0)] ^= 0x10;
        CHECK(hs_strip_memory_open(&memory, 0, &found) && is_same(&found, &first));
    }
}

static void test_the_number_of_writes_may_wrap(void)
{
    struct hs_strip_memory memory;
    struct hs_strip_record found, record = record_of(0);
    prepare();
    hs_strip_memory_open(&memory, 0, &found);
    memory.number = 0xFFFFFFFEu;
    for (int k = 0; k < 5; k++) {
        record.calibration[0].bias[0] = (float)k;
        CHECK(hs_strip_memory_write(&memory, &record));
        CHECK(hs_strip_memory_open(&memory, 0, &found) && is_same(&found, &record));
    }
}

static void test_without_a_chip_the_base_keeps_it_and_says_where_it_cannot(void)
{
    struct hs_strip_memory memory;
    struct hs_strip_record found;
    const struct hs_strip_record record = record_of(4);
    prepare();
    sim.memory[0].present = false;
    CHECK(!hs_strip_memory_open(&memory, 0, &found) && memory.kind == HS_NO_MEMORY &&
          !hs_strip_memory_write(&memory, &record));
    bench.has_flash = true;
    CHECK(!hs_strip_memory_open(&memory, 0, &found) && memory.kind == HS_BASE_FLASH &&
          hs_strip_memory_write(&memory, &record));
    bench.flash_fails = true; /* full, or worn out */
    CHECK(!hs_strip_memory_write(&memory, &record));
    bench.flash_fails = false;
    bench.supply_low = true;
    CHECK(!hs_strip_memory_write(&memory, &record));
    CHECK(hs_strip_memory_open(&memory, 0, &found) && is_same(&found, &record));
}

int main(void)
{
    test_an_empty_memory_has_no_record();
    test_a_power_cut_at_every_byte_loses_nothing();
    test_a_damaged_copy_is_passed_over();
    test_the_number_of_writes_may_wrap();
    test_without_a_chip_the_base_keeps_it_and_says_where_it_cannot();
    PASSED();
    return 0;
}
