// As much of Arduino as the sketch needs, a robot whose sensors fail on command, and what has to come of it.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "canter_policy.h"

// Like the board's, the clock is one of 32 bits: it begins just before it wraps.
static uint32_t now_us = 0xFFFFFFFFu - 3000000u;
static unsigned long micros() { return now_us; }

static bool senses = false;
static unsigned long sent = 0;

static bool sense(canter_sensors *readings) {
  for (int i = 0; i < CANTER_NUM_MOTORS; i++) {
    readings->motor_angles[i] = 0.1f;
    readings->motor_velocities[i] = 0.0f;
  }
  for (int i = 0; i < 3; i++) {
    readings->orientation[i] = readings->angular_velocity[i] = 0.0f;
  }
  return senses;
}

static void moved(const float *) { sent++; }

static struct {
  const char *letters;
  void begin(long) { letters = ""; }
  int available() { return *letters != 0; }
  int read() { return *letters++; }
  void println(const char *text) {
    std::puts(text);
    std::exit(1);
  }
} Serial;

#include "sketch.ino"

static int failures = 0;

static void expect(bool holds, const char *what) {
  if (!holds) {
    std::printf("FAILED: %s (share %g, %lu sent)\n", what, (double)state.share, sent);
    failures++;
  }
}

// So many milliseconds; returns how often targets were sent.
static unsigned long run(unsigned long milliseconds) {
  unsigned long before = sent;
  for (unsigned long i = 0; i < milliseconds; i++) {
    now_us += 1000;
    loop();
  }
  return sent - before;
}

int main() {
  setup();
  expect(run(500) == 0, "without readings nothing is sent");
  senses = true;
  expect(run(1000) == 100, "a step every 10 ms");
  Serial.letters = "w";
  run(1000);
  expect(state.share == 1.0f, "it walks");
  // Over the clock's wrap.
  run(2000);
  expect(state.share == 1.0f, "it still walks");
  senses = false;
  run(100);
  expect(state.share == 0.0f, "it holds");
  float held[CANTER_NUM_MOTORS];
  std::memcpy(held, targets, sizeof held);
  // 71.6 minutes later the clock shows the time of the last reading again.
  for (int minute = 0; minute < 72; minute++) {
    expect(run(60000) == 6000 && std::memcmp(held, targets, sizeof held) == 0, "it still holds");
  }
  senses = true;
  run(1500);
  expect(state.share == 1.0f, "it walks again");
  float phase = state.phase;
  now_us += 1000000;
  unsigned long made_up = 0;
  for (int i = 0; i < 9; i++) {
    now_us += 1000;
    unsigned long before = sent;
    loop();
    made_up += sent - before;
  }
  expect(made_up == 1, "what is late is not made up for");
  expect(state.phase != phase, "it goes on");
  return failures;
}
