// Runs a policy that canter has exported, on a Teensy or any other Arduino board with a floating-point unit.
//
// Copy canter_policy.h, canter_policy.c and this sketch into a folder called canter_sketch, and fill in the two
// functions that know your robot: read_sensors and send_targets. Over the serial line `w` walks and `s` stops.

#include "canter_policy.h"

static canter_state state;
static canter_sensors sensors;
static float targets[CANTER_NUM_MOTORS];
static bool is_safe = false;
static unsigned long last_reading_us = 0;
static unsigned long next_step_us = 0;

static const unsigned long CONTROL_DT_US = (unsigned long)(CANTER_CONTROL_DT_S * 1e6f + 0.5f);

// Yours to write: the newest readings of motors and inertial sensor; false if there are none since the last call.
static bool read_sensors(canter_sensors *readings) {
  (void)readings;
  return false;
}

// Yours to write: position commands to the motors, in the order that canter_policy.h names.
static void send_targets(const float *angles) {
  (void)angles;
}

void setup() {
  Serial.begin(115200);
  canter_init(&state, targets);
  is_safe = canter_self_test() <= CANTER_SELF_TEST_LIMIT;
  last_reading_us = micros() - 1000000UL;
  next_step_us = micros();
}

void loop() {
  if (read_sensors(&sensors)) {
    last_reading_us = micros();
  }
  while (Serial.available() > 0) {
    int letter = Serial.read();
    if (letter == 'w' || letter == 's') {
      canter_walk(&state, letter == 'w');
    }
  }
  if ((long)(micros() - next_step_us) < 0) {
    return;
  }
  next_step_us += CONTROL_DT_US;
  if (!is_safe) {
    Serial.println("self test failed: the motors stay as they are");
    return;
  }
  sensors.age_s = (float)(micros() - last_reading_us) * 1e-6f;
  canter_step(&state, &sensors, CANTER_CONTROL_DT_S, targets);
  send_targets(targets);
}
