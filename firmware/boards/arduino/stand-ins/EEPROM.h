#ifndef STAND_IN_EEPROM_H
#define STAND_IN_EEPROM_H

#include <Arduino.h>

class EEPROMClass
{
  public:
    void begin(size_t size);
    uint8_t read(int address);
    void write(int address, uint8_t value);
    bool commit();
};

extern EEPROMClass EEPROM;

#endif
