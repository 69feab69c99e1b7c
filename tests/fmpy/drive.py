"""Prints the inputs for the runs that are compared bit for bit: a base that sways, and a push on the tip."""

import math

STEP = 0.01
STEPS = 200

print("time,base.position[2],base.velocity[2],tip.force[3]")
for k in range(STEPS + 1):
    time = k * STEP
    position = 0.1 * (1.0 - math.cos(3.0 * time)) / 3.0
    velocity = 0.1 * math.sin(3.0 * time)
    print(time, position, velocity, 0.02 if k < 20 else 0.0, sep=",")
