/* CRC-32 of zlib and Ethernet: reflected, polynomial 04C11DB7, start and final XOR FFFFFFFF. */
#ifndef HS_CRC32_H
#define HS_CRC32_H

#include <stddef.h>
#include <stdint.h>

uint32_t hs_crc32(const uint8_t *data, size_t n);

#endif
