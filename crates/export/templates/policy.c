/* @TITLE@ See canter_policy.h. */
#include "canter_policy.h"

#include <float.h>
#include <math.h>
#include <stddef.h>

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "readings that are no numbers have to be seen: build this without -ffast-math and -ffinite-math-only"
#endif

#define TAU 6.2831853071795864769f
#define PI 3.1415926535897932385f

/* ---- The policy's numbers ---- */

@DATA@
/* ---- Small helpers ---- */

static float clamp(float value, float low, float high)
{
    return value < low ? low : (value > high ? high : value);
}

/* Cycles wrapped into [0, 1); 0 where they are not finite. */
static float wrap_cycles(float cycles)
{
    float wrapped = cycles - floorf(cycles);
    return wrapped >= 0.0f && wrapped < 1.0f ? wrapped : 0.0f;
}

/* ---- Observation ---- */

enum block { MOTOR_ANGLES, MOTOR_VELOCITIES, ORIENTATION, ANGULAR_VELOCITY, PHASE, PREVIOUS_ACTION };

static float *append(float *target, const float *values, size_t count)
{
    size_t i;
    for (i = 0; i < count; i++) {
        target[i] = values[i];
    }
    return target + count;
}

static void observe(const canter_sensors *sensors, float phase, const float *previous_action, float *observation)
{
    static const unsigned char blocks[] = {@BLOCKS@};
    size_t i;
    for (i = 0; i < sizeof blocks; i++) {
        switch (blocks[i]) {
        case MOTOR_ANGLES:
            observation = append(observation, sensors->motor_angles, CANTER_NUM_MOTORS);
            break;
        case MOTOR_VELOCITIES:
            observation = append(observation, sensors->motor_velocities, CANTER_NUM_MOTORS);
            break;
        case ORIENTATION:
            observation = append(observation, sensors->orientation, 3);
            break;
        case ANGULAR_VELOCITY:
            observation = append(observation, sensors->angular_velocity, 3);
            break;
        case PHASE: {
            float circle[2];
            circle[0] = sinf(TAU * phase);
            circle[1] = cosf(TAU * phase);
            observation = append(observation, circle, 2);
            break;
        }
        default:
            observation = append(observation, previous_action, CANTER_NUM_ACTIONS);
            break;
        }
    }
}

/* ---- Policy: mirror, normaliser, network ---- */

#if CANTER_HAS_MIRROR
typedef struct {
    unsigned short source;
    signed char sign;
} component;

static const component mirrored_observation[CANTER_NUM_OBSERVATIONS] = {@MIRRORED_OBSERVATION@};
static const component mirrored_action[CANTER_NUM_ACTIONS] = {@MIRRORED_ACTION@};

/* Exchanges left and right in place. */
static void reflect(const component *components, float *vector, int count)
{
    int i;
    for (i = 0; i < count; i++) {
        int j = components[i].source;
        if (j >= i) {
            float swapped = vector[i];
            vector[i] = vector[j];
            vector[j] = swapped;
            vector[i] *= (float)components[i].sign;
            if (j != i) {
                vector[j] *= (float)components[i].sign;
            }
        }
    }
}
#endif

/* The rational function that the policy was trained with. */
static float policy_tanh(float x)
{
    float s, numerator, denominator;
    x = clamp(x, -@TANH_SATURATION@, @TANH_SATURATION@);
    s = x * x;
    numerator = @TANH_NUMERATOR@;
    denominator = @TANH_DENOMINATOR@;
    return clamp(x * numerator / denominator, -1.0f, 1.0f);
}

/* One layer; the weights of one input lie next to each other. Blocks of eight outputs stay in registers. */
static void layer(const float *weights, const float *biases, int inputs, int outputs, const float *in, float *out)
{
    int i, j = 0;
    for (; j + 8 <= outputs; j += 8) {
        const float *w = weights + j;
        float s0 = biases[j], s1 = biases[j + 1], s2 = biases[j + 2], s3 = biases[j + 3];
        float s4 = biases[j + 4], s5 = biases[j + 5], s6 = biases[j + 6], s7 = biases[j + 7];
        for (i = 0; i < inputs; i++, w += outputs) {
            float x = in[i];
            s0 += x * w[0];
            s1 += x * w[1];
            s2 += x * w[2];
            s3 += x * w[3];
            s4 += x * w[4];
            s5 += x * w[5];
            s6 += x * w[6];
            s7 += x * w[7];
        }
        out[j] = policy_tanh(s0);
        out[j + 1] = policy_tanh(s1);
        out[j + 2] = policy_tanh(s2);
        out[j + 3] = policy_tanh(s3);
        out[j + 4] = policy_tanh(s4);
        out[j + 5] = policy_tanh(s5);
        out[j + 6] = policy_tanh(s6);
        out[j + 7] = policy_tanh(s7);
    }
    for (; j < outputs; j++) {
        float sum = biases[j];
        for (i = 0; i < inputs; i++) {
            sum += in[i] * weights[i * outputs + j];
        }
        out[j] = policy_tanh(sum);
    }
}

static void act(float *observation, float *hidden, float *action)
{
    float *first = hidden, *second = hidden + CANTER_NUM_HIDDEN;
    int i;
#if CANTER_HAS_MIRROR
    int is_mirrored = observation[CANTER_SINE] < 0.0f;
    if (is_mirrored) {
        reflect(mirrored_observation, observation, CANTER_NUM_OBSERVATIONS);
    }
#endif
    for (i = 0; i < CANTER_NUM_OBSERVATIONS; i++) {
        observation[i] = clamp((observation[i] - mean[i]) * inverse_std[i], -@OBSERVATION_LIMIT@, @OBSERVATION_LIMIT@);
    }
    layer(weights_0, biases_0, CANTER_NUM_OBSERVATIONS, CANTER_NUM_HIDDEN, observation, first);
    layer(weights_1, biases_1, CANTER_NUM_HIDDEN, CANTER_NUM_HIDDEN, first, second);
    layer(weights_2, biases_2, CANTER_NUM_HIDDEN, CANTER_NUM_ACTIONS, second, action);
    for (i = 0; i < CANTER_NUM_ACTIONS; i++) {
        /* Where a sensor gave no number the action is 0; canter_step does not let such readings come here. */
        if (action[i] != action[i]) {
            action[i] = 0.0f;
        }
    }
#if CANTER_HAS_MIRROR
    if (is_mirrored) {
        reflect(mirrored_action, action, CANTER_NUM_ACTIONS);
    }
#endif
}

/* ---- Kinematics ---- */

#if CANTER_HAS_TRIANGLES
/* Angle between two sides of a triangle, or that of the nearest triangle that there is. */
static float triangle_angle(float side, float other_side, float opposite)
{
    float cosine = (side * side + other_side * other_side - opposite * opposite) / (2.0f * side * other_side);
    return acosf(clamp(cosine, -1.0f, 1.0f));
}
#endif

#if CANTER_HAS_SEPARATED_HIPS && CANTER_HAS_JOINTS
/* Distance from the middle of the hips to the foot. */
static float leg_length(const leg *l, float extension)
{
    float gamma = l->stance_half_angle - extension;
    float across = l->half_separation + l->upper_link * sinf(gamma);
    float square = l->lower_link * l->lower_link - across * across;
    return l->upper_link * cosf(gamma) + sqrtf(square < 0.0f ? 0.0f : square);
}
#endif

#if CANTER_HAS_SERIAL
/* Angle at the knee by which the lower link departs from the upper link's direction. */
static float fold(const leg *l, float gamma)
{
    return gamma + asinf(clamp(l->upper_link * sinf(gamma) / l->lower_link, -1.0f, 1.0f));
}
#endif

#if CANTER_HAS_JOINTS
/* Angles of the leg's two motors; zero in the standing pose, positive when their link swings forward. */
static void motor_angles(const leg *l, const float position[2], float angles[2])
{
    float swing = position[0], extension = position[1];
#if CANTER_HAS_SERIAL
    if (l->kind == SERIAL) {
        float gamma = l->stance_half_angle - extension;
        float knee = fold(l, l->stance_half_angle) - fold(l, gamma);
        angles[0] = swing - l->knee_side * extension;
        angles[1] = l->knee_side * knee;
        return;
    }
#endif
#if CANTER_HAS_SEPARATED_HIPS
    if (l->half_separation != 0.0f) {
        float length = leg_length(l, extension);
        float forward = length * sinf(swing), down = length * cosf(swing);
        int i;
        for (i = 0; i < 2; i++) {
            float side = i == 0 ? 1.0f : -1.0f;
            float ahead = forward - side * l->half_separation;
            float delta = triangle_angle(l->upper_link, hypotf(ahead, down), l->lower_link);
            angles[i] = atan2f(ahead, down) + side * (delta - l->stance_half_angle);
        }
        return;
    }
#endif
    angles[0] = swing - extension;
    angles[1] = swing + extension;
}
#endif

#if CANTER_CONVERTS_BACK
/* The leg position at these motor angles, or the nearest that the leg can have. */
static void leg_position(const leg *l, const float angles[2], float position[2])
{
#if CANTER_HAS_SERIAL
    if (l->kind == SERIAL) {
        float folded = fold(l, l->stance_half_angle) - l->knee_side * angles[1];
        float squares = l->upper_link * l->upper_link + l->lower_link * l->lower_link
            + 2.0f * l->upper_link * l->lower_link * cosf(folded);
        float length = sqrtf(squares < 0.0f ? 0.0f : squares);
        if (length < @MIN_POSITIVE@) {
            length = @MIN_POSITIVE@;
        }
        position[1] = l->stance_half_angle - triangle_angle(l->upper_link, length, l->lower_link);
        position[0] = angles[0] + l->knee_side * position[1];
        return;
    }
#endif
#if CANTER_HAS_SEPARATED_HIPS
    if (l->half_separation != 0.0f) {
        float knee_forward[2], knee_down[2], forward, down, half, across, square, foot_forward, foot_down, length;
        int i;
        for (i = 0; i < 2; i++) {
            float side = i == 0 ? 1.0f : -1.0f;
            float angle = angles[i] + side * l->stance_half_angle;
            knee_forward[i] = side * l->half_separation + l->upper_link * sinf(angle);
            knee_down[i] = l->upper_link * cosf(angle);
        }
        forward = knee_forward[0] - knee_forward[1];
        down = knee_down[0] - knee_down[1];
        half = 0.5f * hypotf(forward, down);
        if (half < @MIN_POSITIVE@) {
            half = @MIN_POSITIVE@;
        }
        square = l->lower_link * l->lower_link - half * half;
        across = sqrtf(square < 0.0f ? 0.0f : square) / (2.0f * half);
        foot_forward = 0.5f * (knee_forward[0] + knee_forward[1]) - across * down;
        foot_down = 0.5f * (knee_down[0] + knee_down[1]) + across * forward;
        length = hypotf(foot_forward, foot_down);
        position[1] = l->stance_half_angle
            - (triangle_angle(l->upper_link, hypotf(length, l->half_separation), l->lower_link)
               - atan2f(l->half_separation, length));
        position[0] = atan2f(foot_forward, foot_down);
        return;
    }
#endif
    (void)l;
    position[0] = 0.5f * angles[0] + 0.5f * angles[1];
    position[1] = -0.5f * angles[0] + 0.5f * angles[1];
}
#endif

/* Limits a leg position and writes its two targets; a coordinate that is no number is that of the standing pose. */
static void command(const leg *l, const float position[2], float *targets)
{
    float limited[2];
    int i;
    for (i = 0; i < 2; i++) {
        limited[i] = position[i] == position[i] ? position[i] : 0.0f;
        limited[i] = clamp(limited[i], l->limits[i][0], l->limits[i][1]);
    }
#if CANTER_HAS_JOINTS
    if (l->has_joints) {
        float angles[2];
        motor_angles(l, limited, angles);
        for (i = 0; i < 2; i++) {
            targets[i] = l->joint_standing[i] + l->joint_sign[i] * angles[i];
        }
        return;
    }
#endif
    targets[0] = limited[0];
    targets[1] = limited[1];
}

/* ---- Prior and action law ---- */

static float action_component(const float *action, int i)
{
    return action[i] == action[i] ? clamp(action[i], -1.0f, 1.0f) : 0.0f;
}

#if CANTER_MODULATION != CANTER_DIRECT
/* The motion's shape at a leg's phase, both coordinates in [-1, 1]. */
static void wave_at(const leg *l, float phase, float wave[2])
{
#if CANTER_HAS_STEPPING
    if (l->waveform == STEPPING) {
        float stance_height = l->stepping[0], down_amplitude = l->stepping[1], up_amplitude = l->stepping[2];
        float flight_fraction = l->stepping[3], step_length = l->stepping[4];
        float u, direction, depth, forward, down, length, half_angle, extension;
        if (phase < flight_fraction) {
            u = phase / flight_fraction;
            direction = 1.0f;
            depth = -up_amplitude;
        } else {
            u = (phase - flight_fraction) / (1.0f - flight_fraction);
            direction = -1.0f;
            depth = down_amplitude;
        }
        forward = direction * step_length * (u - 0.5f);
        down = stance_height + depth * sinf(PI * u);
        length = hypotf(forward, down);
        half_angle = triangle_angle(l->upper_link, hypotf(l->half_separation, length), l->lower_link)
            - atan2f(l->half_separation, length);
        extension = l->stance_half_angle - half_angle;
        wave[0] = (atan2f(forward, down) - l->centre[0]) / l->half_range[0];
        wave[1] = (extension - l->centre[1]) / l->half_range[1];
        return;
    }
#endif
#if CANTER_HAS_TABLE
    if (l->waveform == TABLE) {
        float place = phase * (float)TABLE_POINTS;
        int i = (int)place % TABLE_POINTS, j = (i + 1) % TABLE_POINTS, k;
        float u = place - floorf(place);
        for (k = 0; k < 2; k++) {
            wave[k] = l->table[2 * i + k] + u * (l->table[2 * j + k] - l->table[2 * i + k]);
        }
        return;
    }
#endif
    wave[0] = sinf(TAU * phase);
    wave[1] = sinf(TAU * wrap_cycles(phase + l->extension_phase));
}

#if CANTER_MODULATION != CANTER_RESIDUAL
static float blend(float normal, float mapped)
{
    return (1.0f - AUTHORITY) * normal + AUTHORITY * mapped;
}
#endif

#if CANTER_MODULATION == CANTER_MODULATE
static float map_range(const float range[2], float normal, float action)
{
    return normal + action * (action < 0.0f ? normal - range[0] : range[1] - normal);
}
#elif CANTER_MODULATION != CANTER_RESIDUAL
static float amplitude(float normal, float action)
{
    float blended = blend(normal, action);
    return blended > @MAX_AMPLITUDE@ ? @MAX_AMPLITUDE@ : blended;
}
#endif

#if CANTER_MODULATION == CANTER_RESIDUAL
/* Adds the policy's two outputs to the targets that the prior has at a position, and makes them a position again. */
static void add_residual(const leg *l, const float *action, float position[2])
{
    float targets[2], moved[2];
    int i;
    command(l, position, targets);
    for (i = 0; i < 2; i++) {
        moved[i] = targets[i] + RESIDUAL_REACH * action_component(action, i);
    }
    if (moved[0] == targets[0] && moved[1] == targets[1]) {
        return;
    }
#if CANTER_HAS_JOINTS
    if (l->has_joints) {
        for (i = 0; i < 2; i++) {
            moved[i] = l->joint_sign[i] * (moved[i] - l->joint_standing[i]);
        }
        leg_position(l, moved, position);
        return;
    }
#endif
    position[0] = moved[0];
    position[1] = moved[1];
}
#endif

/* Where the policy wants leg number `index`. */
static void gait_position(int index, float phase, const float *action, float position[2])
{
    const leg *l = &legs[index];
    float wave[2], amplitudes[2], offsets[2];
    int i;
#if CANTER_MODULATION == CANTER_MODULATE
    int start = 1 + 4 * index;
#elif CANTER_MODULATION == CANTER_LEG_AMPLITUDE || CANTER_MODULATION == CANTER_RESIDUAL
    int start = 2 * index;
#else
    int start = 0;
#endif
    for (i = 0; i < 2; i++) {
#if CANTER_MODULATION == CANTER_MODULATE
        amplitudes[i] = blend(l->amplitudes[i],
                              map_range(amplitude_ranges[i], l->amplitudes[i], action_component(action, start + i)));
        offsets[i] = blend(l->offsets[i],
                           l->offsets[i] + map_range(offset_ranges[i], 0.0f, action_component(action, start + 2 + i)));
#elif CANTER_MODULATION == CANTER_RESIDUAL
        amplitudes[i] = l->amplitudes[i];
        offsets[i] = l->offsets[i];
#else
        amplitudes[i] = amplitude(l->amplitudes[i], action_component(action, start + i));
        offsets[i] = l->offsets[i];
#endif
    }
    wave_at(l, wrap_cycles(phase + l->phase_offset), wave);
    for (i = 0; i < 2; i++) {
        position[i] = offsets[i] + amplitudes[i] * wave[i];
    }
#if CANTER_MODULATION == CANTER_RESIDUAL
    add_residual(l, action + start, position);
#endif
}
#endif

static float stride_frequency_hz(const float *action)
{
#if CANTER_MODULATION == CANTER_MODULATE
    float factor = map_range(frequency_factor, 1.0f, action_component(action, 0));
    return blend(FREQUENCY_HZ, factor * FREQUENCY_HZ);
#else
    (void)action;
    return FREQUENCY_HZ;
#endif
}

/* ---- What the header declares ---- */

static void stand(float targets[CANTER_NUM_MOTORS])
{
    static const float standing[2] = {0.0f, 0.0f};
    int i;
    for (i = 0; i < CANTER_NUM_LEGS; i++) {
        command(&legs[i], standing, targets + 2 * i);
    }
}

/* Writes the targets at which the robot already is, whatever its limits. */
static void stay(const float angles[CANTER_NUM_MOTORS], float targets[CANTER_NUM_MOTORS])
{
    int i;
    for (i = 0; i < CANTER_NUM_LEGS; i++) {
#if CANTER_HAS_JOINTS
        if (legs[i].has_joints) {
            int j;
            for (j = 0; j < 2; j++) {
                targets[2 * i + j] = legs[i].joint_standing[j] + legs[i].joint_sign[j] * angles[2 * i + j];
            }
            continue;
        }
#endif
#if CANTER_HAS_LEG_SPACE
        leg_position(&legs[i], angles + 2 * i, targets + 2 * i);
#endif
    }
}

/* Whether all values are numbers, and none is larger than most. */
static int all_within(const float *values, int count, float most)
{
    int i;
    for (i = 0; i < count; i++) {
        if (!(fabsf(values[i]) <= most)) {
            return 0;
        }
    }
    return 1;
}

/* Whether readings are fresh and made of numbers; leaves the observation in the state. */
static int is_usable(canter_state *state, const canter_sensors *sensors)
{
    if (sensors == NULL || !(sensors->age_s >= 0.0f && sensors->age_s <= CANTER_SENSOR_TIMEOUT_S)) {
        return 0;
    }
    observe(sensors, state->phase, state->action, state->observation);
    /* A whole turn away from standing is no pose of a leg. */
    return all_within(sensors->motor_angles, CANTER_NUM_MOTORS, TAU)
        && all_within(state->observation, CANTER_NUM_OBSERVATIONS, FLT_MAX);
}

/* Every walk begins with phase and action at 0. */
static void rewind_gait(canter_state *state)
{
    int i;
    state->phase = 0.0f;
    for (i = 0; i < CANTER_NUM_ACTIONS; i++) {
        state->action[i] = 0.0f;
    }
}

static void copy(const float *from, float *to)
{
    int i;
    for (i = 0; i < CANTER_NUM_MOTORS; i++) {
        to[i] = from[i];
    }
}

void canter_init(canter_state *state)
{
    state->share = 0.0f;
    state->is_to_walk = 0;
    state->has_begun = 0;
    rewind_gait(state);
}

void canter_walk(canter_state *state, int is_to_walk)
{
    state->is_to_walk = is_to_walk;
}

/* The control law from the observation in the state on. */
static void control(canter_state *state, float dt_s, float targets[CANTER_NUM_MOTORS])
{
    int i;
    act(state->observation, state->hidden, state->action);
    for (i = 0; i < CANTER_NUM_LEGS; i++) {
        float position[2];
#if CANTER_MODULATION == CANTER_DIRECT
        float angles[2];
        angles[0] = action_component(state->action, 2 * i);
        angles[1] = action_component(state->action, 2 * i + 1);
        leg_position(&legs[i], angles, position);
#else
        gait_position(i, state->phase, state->action, position);
#endif
        command(&legs[i], position, targets + 2 * i);
    }
    state->phase = wrap_cycles(state->phase + stride_frequency_hz(state->action) * dt_s);
}

void canter_control(canter_state *state, const canter_sensors *sensors, float dt_s, float targets[CANTER_NUM_MOTORS])
{
    observe(sensors, state->phase, state->action, state->observation);
    control(state, dt_s, targets);
}

/* A step with good readings, of which the observation is in the state. */
static canter_mode advance(canter_state *state, float dt_s, float targets[CANTER_NUM_MOTORS])
{
    float ramp = dt_s / CANTER_RAMP_S;
    int i;
    stand(targets);
    if (state->share == 0.0f) {
        int stands = 1;
        for (i = 0; i < CANTER_NUM_MOTORS; i++) {
            float way = targets[i] - state->last[i];
            if (fabsf(way) > ramp) {
                targets[i] = state->last[i] + (way > 0.0f ? ramp : -ramp);
                stands = 0;
            }
        }
        if (!stands) {
            return CANTER_RISING;
        }
    }
    state->share = clamp(state->is_to_walk ? state->share + ramp : state->share - ramp, 0.0f, 1.0f);
    if (state->share == 0.0f) {
        return CANTER_STANDING;
    }
    copy(targets, state->last);
    control(state, dt_s, targets);
    if (state->share < 1.0f) {
        for (i = 0; i < CANTER_NUM_MOTORS; i++) {
            targets[i] = state->last[i] + state->share * (targets[i] - state->last[i]);
        }
        return state->is_to_walk ? CANTER_RAMPING_IN : CANTER_RAMPING_OUT;
    }
    return CANTER_WALKING;
}

canter_mode canter_step(canter_state *state, const canter_sensors *sensors, float dt_s,
                        float targets[CANTER_NUM_MOTORS])
{
    canter_mode mode;
    if (state->share == 0.0f) {
        rewind_gait(state);
    }
    if (!is_usable(state, sensors)) {
        if (!state->has_begun) {
            return CANTER_WAITING;
        }
        state->share = 0.0f;
        copy(state->last, targets);
        return CANTER_HOLDING;
    }
    if (!state->has_begun) {
        stay(sensors->motor_angles, state->last);
        state->has_begun = 1;
    }
    /* What is no time is no step; and a late one is no leap of the gait. */
    dt_s = dt_s > 0.0f ? clamp(dt_s, 0.0f, CANTER_SENSOR_TIMEOUT_S) : 0.0f;
    mode = advance(state, dt_s, targets);
    copy(targets, state->last);
    return mode;
}

/* ---- Self test ---- */

typedef struct {
    canter_sensors sensors;
    float phase;
    float action[CANTER_NUM_ACTIONS];
    float targets[CANTER_NUM_MOTORS];
    float next_phase;
} test_vector;

static const test_vector test_vectors[] = {
@TEST_VECTORS@};

float canter_self_test(void)
{
    float largest = 0.0f;
    size_t k;
    for (k = 0; k < sizeof test_vectors / sizeof test_vectors[0]; k++) {
        const test_vector *vector = &test_vectors[k];
        canter_state state;
        float targets[CANTER_NUM_MOTORS], error;
        int i;
        canter_init(&state);
        state.phase = vector->phase;
        for (i = 0; i < CANTER_NUM_ACTIONS; i++) {
            state.action[i] = vector->action[i];
        }
        canter_control(&state, &vector->sensors, CANTER_CONTROL_DT_S, targets);
        for (i = 0; i <= CANTER_NUM_MOTORS; i++) {
            error = i < CANTER_NUM_MOTORS ? targets[i] - vector->targets[i] : state.phase - vector->next_phase;
            error = fabsf(error);
            if (!(error < INFINITY)) {
                return INFINITY;
            }
            largest = error > largest ? error : largest;
        }
    }
    return largest;
}
