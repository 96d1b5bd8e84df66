/* Repeats recorded control steps: readings, phase and previous action in, targets, next phase and action out. */
#include "canter_policy.h"

#include <stdio.h>
#include <string.h>

int main(void)
{
    canter_state state;
    canter_sensors sensors;
    float input[2 * CANTER_NUM_MOTORS + 7 + CANTER_NUM_ACTIONS];
    float output[CANTER_NUM_MOTORS + 1 + CANTER_NUM_ACTIONS];
    float error = canter_self_test();
    if (!(error <= CANTER_SELF_TEST_LIMIT)) {
        fprintf(stderr, "self test: %g\n", (double)error);
        return 1;
    }
    while (fread(input, sizeof input, 1, stdin) == 1) {
        float *rest = input;
        canter_init(&state);
        memcpy(&sensors, rest, (2 * CANTER_NUM_MOTORS + 6) * sizeof(float));
        rest += 2 * CANTER_NUM_MOTORS + 6;
        sensors.age_s = 0.0f;
        state.phase = *rest++;
        memcpy(state.action, rest, sizeof state.action);
        canter_control(&state, &sensors, CANTER_CONTROL_DT_S, output);
        output[CANTER_NUM_MOTORS] = state.phase;
        memcpy(output + CANTER_NUM_MOTORS + 1, state.action, sizeof state.action);
        fwrite(output, sizeof output, 1, stdout);
    }
    return 0;
}
