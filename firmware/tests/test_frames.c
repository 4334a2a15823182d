/* Bytes on the wire: stuffing, checksum, frames cut anywhere, and what is no frame. */
#include "core/cobs.h"
#include "core/crc32.h"
#include "tests/bench.h"

static struct hs_frame_reader reader;
static struct hs_frame frame;

static int push_all(const uint8_t *bytes, size_t n)
{
    int frames = 0;
    for (size_t k = 0; k < n; k++) {
        frames += hs_frame_reader_push(&reader, bytes[k], &frame) ? 1 : 0;
    }
    return frames;
}

static void test_crc_is_that_of_zlib(void)
{
    CHECK(hs_crc32((const uint8_t *)"123456789", 9) == 0xCBF43926u);
}

static void test_stuffing_is_undone_for_every_length(void)
{
    static uint8_t data[1200], stuffed[1300], back[1300];
    for (size_t n = 0; n < sizeof data; n++) {
        for (size_t k = 0; k < n; k++) {
            data[k] = n % 3 == 0 ? (uint8_t)(1 + k % 255) : n % 3 == 1 ? 0 : (uint8_t)(k * 7 % 5);
        }
        const size_t m = hs_cobs_encode(data, n, stuffed);
        CHECK(m <= HS_COBS_MOST(n));
        CHECK(memchr(stuffed, 0, m) == NULL);
        CHECK(hs_cobs_decode(stuffed, m, back) == n && memcmp(back, data, n) == 0);
    }
}

static const uint8_t ping[] = {0x02, 0x85, 0x01, 0x02, 0x07, 0x01, 0x01, 0x01, 0x01,
                               0x01, 0x01, 0x05, 0x28, 0x21, 0xf4, 0x67, 0x00};

static void test_the_ping_of_the_protocol_is_read_byte_by_byte(void)
{
    CHECK(push_all(ping, sizeof ping) == 1);
    CHECK(frame.type == HS_PING && frame.sequence == 0 && frame.size == 8 && frame.payload[0] == 7);
}

static void test_a_flipped_bit_anywhere_is_no_frame(void)
{
    for (size_t bit = 0; bit < 8 * (sizeof ping - 1); bit++) {
        uint8_t broken[sizeof ping];
        memcpy(broken, ping, sizeof ping);
        broken[bit / 8] ^= (uint8_t)(1 << bit % 8);
        CHECK(push_all(broken, sizeof broken) == 0);
        CHECK(push_all(ping, sizeof ping) == 1);
    }
}

static void test_half_a_frame_is_passed_over(void)
{
    for (size_t n = 1; n < sizeof ping - 1; n++) {
        push_all(ping, n);
        CHECK(push_all((const uint8_t *)"", 1) == 0);
        CHECK(push_all(ping, sizeof ping) == 1);
    }
}

static void test_a_flood_without_a_zero_does_not_stop_what_follows(void)
{
    for (int k = 0; k < 3 * HS_FRAME; k++) {
        const uint8_t byte = 0x55;
        CHECK(push_all(&byte, 1) == 0);
    }
    const uint32_t before = reader.corrupt;
    CHECK(push_all((const uint8_t *)"", 1) == 0 && reader.corrupt == before);
    CHECK(push_all(ping, sizeof ping) == 1);
}

static void test_a_full_outbox_drops_whole_frames_and_counts_them(void)
{
    static struct hs_outbox outbox;
    int kept = 0;
    for (int k = 0; k < 100; k++) {
        struct hs_writer *w = hs_outbox_begin(&outbox, HS_SAMPLES);
        for (int j = 0; j < 1000; j++) {
            hs_put_uint(w, (uint64_t)j, 1);
        }
        kept += hs_outbox_end(&outbox) ? 1 : 0;
    }
    CHECK(kept > 10 && outbox.overruns == 100u - (uint32_t)kept && outbox.sequence == 100);
    const uint8_t *bytes;
    size_t n;
    int read = 0;
    while ((n = hs_outbox_peek(&outbox, &bytes)) > 0) {
        read += push_all(bytes, n < 333 ? n : 333);
        hs_outbox_drop(&outbox, n < 333 ? n : 333);
    }
    CHECK(read == kept && frame.sequence == kept - 1 && frame.size == 1000);
    hs_put(hs_outbox_begin(&outbox, 1), bench.to_host, HS_BODY + 1); /* longer than any frame */
    CHECK(!hs_outbox_end(&outbox) && outbox.used == 0);
}

int main(void)
{
    test_crc_is_that_of_zlib();
    test_stuffing_is_undone_for_every_length();
    test_the_ping_of_the_protocol_is_read_byte_by_byte();
    test_a_flipped_bit_anywhere_is_no_frame();
    test_half_a_frame_is_passed_over();
    test_a_flood_without_a_zero_does_not_stop_what_follows();
    test_a_full_outbox_drops_whole_frames_and_counts_them();
    PASSED();
    return 0;
}
