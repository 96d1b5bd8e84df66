/* Steps of the whole runtime: readings with their age, whether to walk and the step's time in, targets and mode out. */
#include "canter_policy.h"

#include <stdio.h>
#include <string.h>

int main(void)
{
    canter_state state;
    canter_sensors sensors;
    float input[2 * CANTER_NUM_MOTORS + 9], targets[CANTER_NUM_MOTORS] = {0.0f}, output[CANTER_NUM_MOTORS + 1];
    canter_init(&state);
    while (fread(input, sizeof input, 1, stdin) == 1) {
        memcpy(&sensors, input, sizeof sensors);
        canter_walk(&state, input[2 * CANTER_NUM_MOTORS + 7] != 0.0f);
        output[CANTER_NUM_MOTORS] = (float)canter_step(&state, &sensors, input[2 * CANTER_NUM_MOTORS + 8], targets);
        memcpy(output, targets, sizeof targets);
        fwrite(output, sizeof output, 1, stdout);
    }
    return 0;
}
