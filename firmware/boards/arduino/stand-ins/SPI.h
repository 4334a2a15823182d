#ifndef STAND_IN_SPI_H
#define STAND_IN_SPI_H

#include <Arduino.h>

enum { LSBFIRST, MSBFIRST, SPI_MODE0 = 0 };

struct SPISettings {
    SPISettings(uint32_t hz, uint8_t order, uint8_t mode);
};

class SPIClass
{
  public:
    void begin();
    void beginTransaction(SPISettings settings);
    void endTransaction();
    uint8_t transfer(uint8_t byte);
};

extern SPIClass SPI;

#endif
