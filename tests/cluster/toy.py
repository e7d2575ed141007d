"""A program that stands for a simulator: two formulas with 1 % of scatter."""

import json
import random

with open("parameters.json") as file:
    given = json.load(file)
random.seed(given["seed"])
friction = given["parameters"]["friction"]
rolling = given["parameters"]["rolling"]
angle_deg = (18 + 18 * friction + 40 * rolling) * random.gauss(1, 0.01)
time_s = (3 + 2 * friction - 2 * rolling) * random.gauss(1, 0.01)
with open("responses.json", "w") as file:
    json.dump({"angle_deg": angle_deg, "time_s": time_s}, file)
