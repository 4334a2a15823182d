/* Bytes cut anywhere become frames; what is no frame is counted and passed over up to the next zero
 * byte. */
#ifndef HS_FRAME_READER_H
#define HS_FRAME_READER_H

#include "core/bytes.h"
#include "core/limits.h"

struct hs_frame {
    uint8_t type;
    uint16_t sequence;
    const uint8_t *payload; /* valid until the next byte is pushed */
    size_t size;
};

struct hs_frame_reader {
    uint8_t bytes[HS_FRAME];
    size_t n;
    bool skipping;    /* the tail of something too long to be a frame */
    uint32_t corrupt; /* frames with wrong COBS, length or CRC */
};

/* Take one byte; true where it completed a frame. */
bool hs_frame_reader_push(struct hs_frame_reader *reader, uint8_t byte, struct hs_frame *frame);

#endif
