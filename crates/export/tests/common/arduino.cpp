// As much of Arduino as the sketch needs; time passes a millisecond a look at the clock.
#include <cstdio>

static unsigned long now_us = 0;
static unsigned long micros() {
  return now_us += 1000;
}

static struct {
  const char *letters;
  void begin(long) { letters = "w"; }
  int available() { return *letters != 0; }
  int read() { return *letters++; }
  void println(const char *text) { std::puts(text); }
} Serial;

#include "sketch.ino"

int main() {
  setup();
  unsigned long steps = 0, planned = next_step_us;
  while (steps < 200) {
    loop();
    steps += (next_step_us - planned) / CONTROL_DT_US;
    planned = next_step_us;
  }
  std::printf("%lu steps, mode %d\n", steps, is_safe ? (int)canter_step(&state, &sensors, CANTER_CONTROL_DT_S, targets) : -1);
  return 0;
}
