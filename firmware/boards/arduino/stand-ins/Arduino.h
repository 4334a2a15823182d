// As much of the Arduino interface as the library uses, to compile it where no board is: nothing
// here runs.
#ifndef STAND_IN_ARDUINO_H
#define STAND_IN_ARDUINO_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { LOW, HIGH, INPUT, OUTPUT, INPUT_PULLUP, A0 = 14 };

class Print
{
  public:
    virtual ~Print() {}
    virtual size_t write(uint8_t byte) = 0;
    virtual size_t write(const uint8_t *bytes, size_t n) = 0;
    virtual int availableForWrite() = 0;
};

class Stream : public Print
{
  public:
    virtual int available() = 0;
    virtual int read() = 0;
};

class SerialPort : public Stream
{
  public:
    void begin(unsigned long baud);
    size_t write(uint8_t byte) override;
    size_t write(const uint8_t *bytes, size_t n) override;
    int availableForWrite() override;
    int available() override;
    int read() override;
};

extern SerialPort Serial;

uint32_t micros();
void delayMicroseconds(unsigned int us);
void pinMode(uint8_t pin, uint8_t mode);
void digitalWrite(uint8_t pin, uint8_t value);
int digitalRead(uint8_t pin);
int analogRead(uint8_t pin);

#endif
