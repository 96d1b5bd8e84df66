// Runs a policy that canter has exported, on a Teensy or any other Arduino board with a floating-point unit.
//
// Copy canter_policy.h, canter_policy.c and this sketch into a folder called canter_sketch, and fill in the two
// functions that know your robot: read_sensors and send_targets. Over the serial line `w` walks and `s` stops.

#include <math.h>
#include <stdint.h>

#include "canter_policy.h"

static canter_state state;
static canter_sensors sensors;
static float targets[CANTER_NUM_MOTORS];
static bool is_safe = false;
static bool has_reading = false;
static uint32_t last_reading_us = 0;
static uint32_t next_step_us = 0;

static const uint32_t CONTROL_DT_US = (uint32_t)(CANTER_CONTROL_DT_S * 1e6f + 0.5f);
// Older readings are none. micros() begins anew after 71 minutes: by then this has long been noticed.
static const uint32_t FORGET_US = 1000000;

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
  canter_init(&state);
  is_safe = canter_self_test() <= CANTER_SELF_TEST_LIMIT;
  next_step_us = micros();
}

void loop() {
  if (read_sensors(&sensors)) {
    last_reading_us = micros();
    has_reading = true;
  }
  while (Serial.available() > 0) {
    int letter = Serial.read();
    if (letter == 'w' || letter == 's') {
      canter_walk(&state, letter == 'w');
    }
  }
  uint32_t now_us = micros();
  uint32_t age_us = now_us - last_reading_us;
  has_reading = has_reading && age_us < FORGET_US;
  uint32_t late_us = now_us - next_step_us;
  if ((int32_t)late_us < 0) {
    return;
  }
  // A late step is not made up for by a hasty one.
  next_step_us = (late_us < CONTROL_DT_US ? next_step_us : now_us) + CONTROL_DT_US;
  if (!is_safe) {
    Serial.println("self test failed: the motors stay as they are");
    return;
  }
  sensors.age_s = has_reading ? (float)age_us * 1e-6f : INFINITY;
  if (canter_step(&state, &sensors, CANTER_CONTROL_DT_S, targets) != CANTER_WAITING) {
    send_targets(targets);
  }
}
