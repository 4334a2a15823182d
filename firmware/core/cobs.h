/* Consistent-overhead byte stuffing (Cheshire and Baker 1999), without the zero byte that ends a
 * frame. */
#ifndef HS_COBS_H
#define HS_COBS_H

#include <stddef.h>
#include <stdint.h>

#define HS_COBS_MOST(n) ((n) + (n) / 254 + 1) /* bytes that n may become */

/* Stuff n bytes into `out`, which has room for HS_COBS_MOST(n); gives the bytes written. */
size_t hs_cobs_encode(const uint8_t *data, size_t n, uint8_t *out);

/* Undo it, in place where `out` is `data`; gives the bytes written, or (size_t)-1 where a zero
 * stands in it or a block runs past the end. */
size_t hs_cobs_decode(const uint8_t *data, size_t n, uint8_t *out);

#endif
