/* @TITLE@
 *
 * Written by canter @VERSION@. C99, no heap, no dependency but the mathematics library (-lm).
 * One control step of @RATE@ Hz:
 *
 *     canter_state state;
 *     float targets[CANTER_NUM_MOTORS];
 *     canter_init(&state);
 *     every CANTER_CONTROL_DT_S:
 *         fill in sensors, with their age;
 *         if (canter_step(&state, &sensors, CANTER_CONTROL_DT_S, targets) != CANTER_WAITING)
 *             send targets to the actuators
 *     canter_walk(&state, 1);                once it stands: it gets going
 *     canter_walk(&state, 0);                it comes to a stand
 *
 * With the first readings the robot rises from where it is to its standing pose: 1 rad in CANTER_RAMP_S at most.
 *
 * Angles are in rad, angular velocities in rad/s, times in s.
 */
#ifndef CANTER_POLICY_H
#define CANTER_POLICY_H

#ifdef __cplusplus
extern "C" {
#endif

#define CANTER_ROBOT "@ROBOT@"
#define CANTER_GAIT "@GAIT@"
#define CANTER_NUM_LEGS @NUM_LEGS@
#define CANTER_NUM_MOTORS (2 * CANTER_NUM_LEGS)
#define CANTER_NUM_OBSERVATIONS @NUM_OBSERVATIONS@
#define CANTER_NUM_ACTIONS @NUM_ACTIONS@
#define CANTER_NUM_HIDDEN @NUM_HIDDEN@
#define CANTER_CONTROL_DT_S @CONTROL_DT@
/* From standing to the whole gait, and back. */
#define CANTER_RAMP_S @RAMP@
/* Readings that are older are stale: the robot holds its pose. So are those in which a motor angle is beyond a whole turn, or
 * anything that the policy uses is not finite. */
#define CANTER_SENSOR_TIMEOUT_S @TIMEOUT@
/* Targets and motors, two a leg, in this order: @ACTUATORS@ */

/* What the sensors say. @UNUSED@ */
typedef struct {
    /* Angles of the motor joints, zero in the standing pose, positive when the link swings forward. */
    float motor_angles[CANTER_NUM_MOTORS];
    float motor_velocities[CANTER_NUM_MOTORS];
    /* Roll and pitch against gravity, yaw against the direction in which to walk (intrinsic z-y-x). */
    float orientation[3];
    /* In the body's frame: forward, left, up. */
    float angular_velocity[3];
    /* Time since these were read. */
    float age_s;
} canter_sensors;

/* What the robot is doing. */
typedef enum {
    CANTER_WAITING = 0,     /* no readings yet, no targets: send nothing */
    CANTER_RISING = 1,      /* to the standing pose, from where it was found or was held */
    CANTER_STANDING = 2,
    CANTER_RAMPING_IN = 3,
    CANTER_WALKING = 4,
    CANTER_RAMPING_OUT = 5,
    CANTER_HOLDING = 6      /* its last targets, for want of fresh readings */
} canter_mode;

/* All that a step depends on, and its working memory; nothing is kept elsewhere. */
typedef struct {
    float phase;
    float share;
    int is_to_walk;
    int has_begun;
    float action[CANTER_NUM_ACTIONS];
    float last[CANTER_NUM_MOTORS];
    float observation[CANTER_NUM_OBSERVATIONS];
    float hidden[2 * CANTER_NUM_HIDDEN];
} canter_state;

/* A robot that waits for its first readings. */
void canter_init(canter_state *state);

/* Tells the robot to walk, or to come to a stand. */
void canter_walk(canter_state *state, int is_to_walk);

/* One control step of dt_s: sensors in, targets out. Without fresh readings (or with a null pointer) the pose is held.
 * A step that lasts longer than CANTER_SENSOR_TIMEOUT_S counts as one that long. */
canter_mode canter_step(canter_state *state, const canter_sensors *sensors, float dt_s,
                        float targets[CANTER_NUM_MOTORS]);

/* The bare control law that canter_step ramps: uses and moves on state->phase and state->action. */
void canter_control(canter_state *state, const canter_sensors *sensors, float dt_s, float targets[CANTER_NUM_MOTORS]);

/* Runs the built-in test vectors and returns the largest error: of a target in rad, of the next phase in cycles.
 * Above CANTER_SELF_TEST_LIMIT this program must not move a robot. */
float canter_self_test(void);
#define CANTER_SELF_TEST_LIMIT 1e-5f

#ifdef __cplusplus
}
#endif

#endif
