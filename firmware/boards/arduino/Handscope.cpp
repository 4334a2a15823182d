#include "Handscope.h"

#include <EEPROM.h>
#include <SPI.h>
#include <Wire.h>

#if defined(ESP32) || defined(ARDUINO_ARCH_RP2040)
#define EEPROM_IS_EMULATED // in flash, written by commit()
#endif

namespace
{

constexpr uint32_t SPI_HZ = 4000000, I2C_HZ = 1000000;
constexpr size_t PAGE = 512, PAGES = 8; // of the base unit's own EEPROM: two a strip, for strips at
                                        // slots 0 to 3 without a memory chip

hs_glove glove;
hs_strip_layout strips[HS_STRIPS];
HandscopeStrip pins[HS_STRIPS];
hs_layout layout;
Stream *host;
int8_t address_pins[2] = {-1, -1};
bool (*show_cue)(const char *);
float mounting[4];

const HandscopeStrip *strip_at(uint8_t slot)
{
    for (uint8_t k = 0; k < layout.count; k++) {
        if (pins[k].slot == slot) {
            return &pins[k];
        }
    }
    return nullptr;
}

// The pin that selects a chip, with the decoder's address set; -1: the strip has no such chip.
int8_t selecting_pin(const HandscopeStrip &strip, uint8_t select)
{
    if (strip.enable < 0) {
        return select == HS_SELECT_MEMORY ? strip.memory
               : select < HS_PER_STRIP    ? strip.select[select]
                                          : -1;
    }
    const uint8_t line = select == HS_SELECT_MEMORY ? 3 : select;
    digitalWrite(address_pins[0], line & 1);
    digitalWrite(address_pins[1], line >> 1 & 1);
    return strip.enable;
}

bool transfer_i2c(const hs_bus &bus, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in)
{
    Wire.beginTransmission(bus.i2c_address);
    Wire.write(out, n_out);
    if (Wire.endTransmission(n_in == 0) != 0) {
        return false;
    }
    if (n_in > 0 && Wire.requestFrom(bus.i2c_address, static_cast<uint8_t>(n_in)) != n_in) {
        return false;
    }
    for (size_t k = 0; k < n_in; k++) {
        in[k] = static_cast<uint8_t>(Wire.read());
    }
    return true;
}

bool transfer_spi(int8_t pin, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in)
{
    SPI.beginTransaction(SPISettings(SPI_HZ, MSBFIRST, SPI_MODE0));
    digitalWrite(pin, LOW);
    for (size_t k = 0; k < n_out; k++) {
        SPI.transfer(out[k]);
    }
    for (size_t k = 0; k < n_in; k++) {
        in[k] = SPI.transfer(0);
    }
    digitalWrite(pin, HIGH);
    SPI.endTransaction();
    return true;
}

void set_up_pins(const HandscopeStrip &strip)
{
    const int8_t all[] = {strip.enable, strip.memory};
    for (const int8_t pin : all) {
        if (pin >= 0) {
            digitalWrite(pin, HIGH);
            pinMode(pin, OUTPUT);
        }
    }
    for (const int8_t pin : strip.select) {
        if (pin >= 0) {
            digitalWrite(pin, HIGH);
            pinMode(pin, OUTPUT);
        }
    }
}

} // namespace

extern "C" {

uint64_t board_now(void)
{
    static uint32_t before;
    static uint64_t wraps;
    const uint32_t now = micros();
    wraps += now < before ? UINT64_C(1) << 32 : 0;
    before = now;
    return (wraps + now) * 1000;
}

void board_wait(uint32_t microseconds) { delayMicroseconds(microseconds); }

bool board_transfer(const hs_bus *bus, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in)
{
    const HandscopeStrip *strip = strip_at(bus->slot);
    if (strip == nullptr) {
        return false;
    }
    if (bus->i2c_address != 0) {
        return transfer_i2c(*bus, out, n_out, in, n_in);
    }
    const int8_t pin = selecting_pin(*strip, bus->select);
    return pin >= 0 && transfer_spi(pin, out, n_out, in, n_in);
}

size_t board_send(const uint8_t *bytes, size_t n)
{
    const int room = host->availableForWrite();
    const size_t part = room < 0                        ? 0
                        : n < static_cast<size_t>(room) ? n
                                                        : static_cast<size_t>(room);
    return part == 0 ? 0 : host->write(bytes, part);
}

size_t board_receive(uint8_t *bytes, size_t n)
{
    size_t got = 0;
    while (got < n && host->available() > 0) {
        bytes[got++] = static_cast<uint8_t>(host->read());
    }
    return got;
}

bool board_flash_read(uint8_t page, uint8_t *bytes, size_t n)
{
    for (size_t k = 0; page < PAGES && k < n; k++) {
        bytes[k] = k < PAGE ? EEPROM.read(static_cast<int>(page * PAGE + k)) : 0xFF;
    }
    return page < PAGES;
}

bool board_flash_write(uint8_t page, const uint8_t *bytes, size_t n)
{
    if (page >= PAGES || n > PAGE) {
        return false;
    }
    for (size_t k = 0; k < n; k++) {
        EEPROM.write(static_cast<int>(page * PAGE + k), bytes[k]);
    }
#ifdef EEPROM_IS_EMULATED
    return EEPROM.commit();
#else
    return true;
#endif
}

// Noise of an open analogue input and the time at which it is read.
uint32_t board_random(void)
{
    static uint32_t state = 2166136261u;
    for (int k = 0; k < 64; k++) {
        state = (state ^ static_cast<uint32_t>(analogRead(A0)) ^ micros()) * 16777619u;
    }
    return state;
}

// A sketch that has set up its chip's watchdog or brown-out detector says so by functions of these
// names.
__attribute__((weak)) void handscope_feed_watchdog(void) {}
__attribute__((weak)) bool handscope_supply_is_low(void) { return false; }
__attribute__((weak)) uint8_t handscope_battery(void) { return 255; }
void board_feed_watchdog(void) { handscope_feed_watchdog(); }
bool board_supply_is_low(void) { return handscope_supply_is_low(); }
uint8_t board_battery(void) { return handscope_battery(); }
bool board_show_cue(const char *task) { return show_cue != nullptr && show_cue(task); }

} // extern "C"

bool HandscopeGlove::addStrip(const HandscopeStrip &strip)
{
    static const hs_driver *const drivers[] = {&hs_icm42688p, &hs_lsm6dsv16x, &hs_mmc5983ma};
    if (layout.count == HS_STRIPS) {
        return false;
    }
    const int which = strip.chip == HANDSCOPE_MMC5983MA ? 1 : 0;
    hs_strip_layout &made = strips[layout.count];
    pins[layout.count++] = strip;
    made.slot = strip.slot;
    made.count = strip.count;
    memcpy(made.points, strip.points, sizeof made.points);
    made.drivers[which] = drivers[strip.chip];
    made.i2c_address[which] = strip.i2cAddress;
    made.mounting = strip.points[0] >= HS_TRUNK ? nullptr : mounting;
    return true;
}

const char *HandscopeGlove::begin(hs_hand hand, const char *name, uint64_t number, Stream &to,
                                  int8_t addressPin0, int8_t addressPin1)
{
    memcpy(mounting, hs_mounting_on(hand), sizeof mounting);
    host = &to;
    address_pins[0] = addressPin0;
    address_pins[1] = addressPin1;
    for (const int8_t pin : address_pins) {
        if (pin >= 0) {
            pinMode(pin, OUTPUT);
        }
    }
    for (uint8_t k = 0; k < layout.count; k++) {
        set_up_pins(pins[k]);
    }
#ifdef EEPROM_IS_EMULATED
    EEPROM.begin(PAGE * PAGES);
#endif
    SPI.begin();
    Wire.begin();
    Wire.setClock(I2C_HZ);
    layout.device_id = number;
    layout.hand = static_cast<uint8_t>(hand);
    layout.name = name;
    layout.strips = strips;
    return hs_glove_start(&glove, &layout);
}

void HandscopeGlove::poll() { hs_glove_poll(&glove); }

void HandscopeGlove::mark(const char *what)
{
    hs_glove_mark(&glove, board_now(), 0, what, nullptr);
}

void HandscopeGlove::onCue(bool (*show)(const char *task)) { show_cue = show; }

HandscopeGlove Handscope;
