// The smallest glove: three sensors on one finger and one on the hand, with a select pin each.
#include <Handscope.h>

void setup()
{
    Serial.begin(115200);
    HandscopeStrip finger = {2, 3, {HS_INDEX, HS_INDEX + 1, HS_INDEX + 2}, HANDSCOPE_LSM6DSV16X};
    HandscopeStrip hand = {0, 1, {HS_ON_HAND}, HANDSCOPE_LSM6DSV16X};
    finger.select[0] = 4;
    finger.select[1] = 5;
    finger.select[2] = 6;
    hand.select[0] = 7;
    Handscope.addStrip(finger);
    Handscope.addStrip(hand);
    Handscope.begin(HS_RIGHT, "One finger", 0x1002, Serial);
}

void loop() { Handscope.poll(); }
