#ifndef STAND_IN_WIRE_H
#define STAND_IN_WIRE_H

#include <Arduino.h>

class TwoWire
{
  public:
    void begin();
    void setClock(uint32_t hz);
    void beginTransmission(uint8_t address);
    uint8_t endTransmission(bool stop);
    uint8_t requestFrom(uint8_t address, uint8_t n);
    size_t write(const uint8_t *bytes, size_t n);
    int read();
};

extern TwoWire Wire;

#endif
