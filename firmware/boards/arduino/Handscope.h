// A glove that speaks Handscope's wire protocol, from inertial sensors on SPI or I2C. Five calls:
// addStrip, begin, poll, mark, onCue. Compiled against stand-ins of the Arduino interface; not yet
// run on hardware.
#ifndef HANDSCOPE_H
#define HANDSCOPE_H

#include <Arduino.h>

extern "C" {
#include "core/glove.h"
#include "core/hand_layout.h"
}

enum HandscopeChip { HANDSCOPE_ICM42688P, HANDSCOPE_LSM6DSV16X, HANDSCOPE_MMC5983MA };

// A strip at a connector. With a 2-to-4 decoder on the strip: `enable` is the connector's own pin,
// and the decoder's outputs 0 to 2 select the sensors, 3 the memory chip. Without one: `select` are
// the sensors' own pins, `memory` that of the memory chip. By I2C: the address of the first sensor,
// the next ones follow.
struct HandscopeStrip {
    uint8_t slot;
    uint8_t count;
    uint8_t points[HS_PER_STRIP]; // enum hs_point: HS_ON_HAND, HS_INDEX, HS_INDEX + 1, ...
    HandscopeChip chip;
    int8_t enable = -1;
    int8_t select[HS_PER_STRIP] = {-1, -1, -1, -1, -1, -1, -1, -1};
    int8_t memory = -1;
    uint8_t i2cAddress = 0;
};

class HandscopeGlove
{
  public:
    // Before begin(), once a connector; false where there are more than HS_STRIPS.
    bool addStrip(const HandscopeStrip &strip);

    // `number` tells this glove from every other. `addressPins`: the decoders' two address lines,
    // if there are decoders. nullptr, or what is wrong.
    const char *begin(hs_hand hand, const char *name, uint64_t number, Stream &host,
                      int8_t addressPin0 = -1, int8_t addressPin1 = -1);

    // In loop(), without delays of your own.
    void poll();

    // The wearer pressed the button: an event in the recording.
    void mark(const char *what);

    // What the host wants the wearer to do; return false for a task that is not known.
    void onCue(bool (*show)(const char *task));
};

extern HandscopeGlove Handscope;

#endif
