// A whole hand: 17 sensors on seven strips, each with a 2-to-4 decoder and a memory chip.
// Wiring: docs/build-a-glove.md. Pins are those of a Teensy 4.0; on another board change them.
#include <Handscope.h>

const int8_t ADDRESS_0 = 2, ADDRESS_1 = 3, BUTTON = 14, LAMP = 15;

bool showCue(const char *task)
{
    digitalWrite(LAMP, task[0] != 0 ? HIGH : LOW);
    return true;
}

void setup()
{
    Serial.begin(115200);
    pinMode(BUTTON, INPUT_PULLUP);
    pinMode(LAMP, OUTPUT);
    const HandscopeChip chip = HANDSCOPE_ICM42688P;
    Handscope.addStrip({0, 1, {HS_ON_HAND}, chip, 4});
    Handscope.addStrip({1, 3, {HS_THUMB, HS_THUMB + 1, HS_THUMB + 2}, chip, 5});
    Handscope.addStrip({2, 3, {HS_INDEX, HS_INDEX + 1, HS_INDEX + 2}, chip, 6});
    Handscope.addStrip({3, 3, {HS_MIDDLE, HS_MIDDLE + 1, HS_MIDDLE + 2}, chip, 7});
    Handscope.addStrip({4, 3, {HS_RING_FINGER, HS_RING_FINGER + 1, HS_RING_FINGER + 2}, chip, 8});
    Handscope.addStrip({5, 3, {HS_LITTLE, HS_LITTLE + 1, HS_LITTLE + 2}, chip, 9});
    Handscope.addStrip({6, 1, {HS_FOREARM}, chip, 10});
    Handscope.onCue(showCue);
    Handscope.begin(HS_LEFT, "My glove", 0x1001, Serial, ADDRESS_0, ADDRESS_1);
}

void loop()
{
    static bool wasPressed = false;
    const bool pressed = digitalRead(BUTTON) == LOW;
    if (pressed && !wasPressed) {
        Handscope.mark("button");
    }
    wasPressed = pressed;
    Handscope.poll();
}
