#include "core/cobs.h"

size_t hs_cobs_encode(const uint8_t *data, size_t n, uint8_t *out)
{
    size_t code_at = 0, at = 1;
    uint8_t code = 1;
    for (size_t k = 0; k < n; k++) {
        if (data[k] != 0) {
            out[at++] = data[k];
            code++;
        }
        if (data[k] == 0 || (code == 255 && k + 1 < n)) {
            out[code_at] = code;
            code_at = at++;
            code = 1;
        }
    }
    out[code_at] = code;
    return at;
}

size_t hs_cobs_decode(const uint8_t *data, size_t n, uint8_t *out)
{
    size_t k = 0, at = 0;
    while (k < n) {
        const size_t block = data[k];
        if (block == 0 || k + block > n) {
            return (size_t)-1;
        }
        for (size_t j = k + 1; j < k + block; j++) {
            if (data[j] == 0) {
                return (size_t)-1;
            }
            out[at++] = data[j];
        }
        k += block;
        if (block < 255 && k < n) {
            out[at++] = 0;
        }
    }
    return at;
}
