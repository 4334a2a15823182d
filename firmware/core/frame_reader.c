#include "core/frame_reader.h"

#include "core/cobs.h"
#include "core/crc32.h"

static bool open_frame(struct hs_frame_reader *reader, struct hs_frame *frame)
{
    const size_t n = hs_cobs_decode(reader->bytes, reader->n, reader->bytes);
    struct hs_reader at = {reader->bytes, n, 0, false};
    if (n == (size_t)-1 || n < 7) {
        return false;
    }
    frame->type = (uint8_t)hs_get_uint(&at, 1);
    frame->sequence = (uint16_t)hs_get_uint(&at, 2);
    frame->payload = reader->bytes + 3;
    frame->size = n - 7;
    at.at = n - 4;
    return hs_get_uint(&at, 4) == hs_crc32(reader->bytes, n - 4);
}

bool hs_frame_reader_push(struct hs_frame_reader *reader, uint8_t byte, struct hs_frame *frame)
{
    if (byte != 0) {
        if (reader->n == sizeof reader->bytes) {
            reader->corrupt += reader->skipping ? 0 : 1;
            reader->skipping = true;
        }
        if (!reader->skipping) {
            reader->bytes[reader->n++] = byte;
        }
        return false;
    }
    const bool complete = !reader->skipping && reader->n > 0 && open_frame(reader, frame);
    reader->corrupt += (!reader->skipping && reader->n > 0 && !complete) ? 1 : 0;
    reader->n = 0;
    reader->skipping = false;
    return complete;
}
