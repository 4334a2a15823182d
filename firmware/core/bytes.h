/* Little-endian numbers into and out of byte buffers; a buffer that is too short is remembered,
 * nothing is written past its end. */
#ifndef HS_BYTES_H
#define HS_BYTES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

struct hs_writer {
    uint8_t *data;
    size_t size, at;
    bool full; /* something did not fit */
};

struct hs_reader {
    const uint8_t *data;
    size_t size, at;
    bool short_of; /* more was asked for than there is */
};

static inline void hs_put(struct hs_writer *w, const void *bytes, size_t n)
{
    if (n > w->size - w->at) {
        w->full = true;
        return;
    }
    if (n > 0) {
        memcpy(w->data + w->at, bytes, n);
    }
    w->at += n;
}

static inline void hs_put_uint(struct hs_writer *w, uint64_t value, size_t n)
{
    uint8_t bytes[8];
    for (size_t k = 0; k < n; k++) {
        bytes[k] = (uint8_t)(value >> (8 * k));
    }
    hs_put(w, bytes, n);
}

static inline void hs_put_f32(struct hs_writer *w, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    hs_put_uint(w, bits, 4);
}

static inline void hs_put_f64(struct hs_writer *w, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    hs_put_uint(w, bits, 8);
}

/* Length byte and at most 255 bytes of UTF-8; no letter is cut in two. */
static inline void hs_put_text(struct hs_writer *w, const char *text)
{
    size_t n = strlen(text);
    if (n > 255) {
        n = 255;
        while (n > 0 && ((uint8_t)text[n] & 0xC0) == 0x80) {
            n--;
        }
    }
    hs_put_uint(w, n, 1);
    hs_put(w, text, n);
}

static inline uint64_t hs_get_uint(struct hs_reader *r, size_t n)
{
    uint64_t value = 0;
    if (n > r->size - r->at) {
        r->short_of = true;
        return 0;
    }
    for (size_t k = 0; k < n; k++) {
        value |= (uint64_t)r->data[r->at++] << (8 * k);
    }
    return value;
}

static inline float hs_get_f32(struct hs_reader *r)
{
    uint32_t bits = (uint32_t)hs_get_uint(r, 4);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline double hs_get_f64(struct hs_reader *r)
{
    uint64_t bits = hs_get_uint(r, 8);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Text into `out` of `size` bytes, zero at the end; what does not fit is left out. */
static inline void hs_get_text(struct hs_reader *r, char *out, size_t size)
{
    size_t n = (size_t)hs_get_uint(r, 1);
    size_t taken = n < size ? n : size - 1;
    if (r->short_of || n > r->size - r->at) {
        r->short_of = true;
        taken = 0;
    } else {
        memcpy(out, r->data + r->at, taken);
        r->at += n;
    }
    out[taken] = 0;
}

#endif
