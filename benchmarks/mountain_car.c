/* The baseline of the kernels: tile-coded learners on the mountain car, one thread, plain C.

   Usage: mountain_car LEARNER STEPS RUNS, LEARNER one of copdac-q, stochastic-ac.
   Prints nanoseconds per step, and steps at the end of the last episode (so that nothing is
   optimised away). Ten tilings of 10 x 10 tiles and a bias, double precision. */
#define _POSIX_C_SOURCE 199309L
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { TILINGS = 10, GRID = 10, SIZE = TILINGS * GRID * GRID + 1, ACTIVE = TILINGS + 1, LAYERS = 256 };

static uint64_t stream[4];
static double edges[LAYERS + 1], heights[LAYERS + 1];

static uint64_t rotated(uint64_t x, int k) { return (x << k) | (x >> (64 - k)); }

static uint64_t bits(void) {
  uint64_t found = rotated(stream[0] + stream[3], 23) + stream[0], shifted = stream[1] << 17;
  stream[2] ^= stream[0];
  stream[3] ^= stream[1];
  stream[1] ^= stream[2];
  stream[0] ^= stream[3];
  stream[2] ^= shifted;
  stream[3] = rotated(stream[3], 45);
  return found;
}

static double uniform(void) { return (bits() >> 11) * 0x1p-53; }

static void ziggurat(void) {
  const double tail = 3.6541528853610088, area = 0.00492867323399;
  edges[0] = area / exp(-tail * tail / 2);
  edges[1] = tail;
  for (int i = 2; i < LAYERS; i++)
    edges[i] = sqrt(-2 * log(exp(-edges[i - 1] * edges[i - 1] / 2) + area / edges[i - 1]));
  edges[LAYERS] = 0;
  for (int i = 0; i <= LAYERS; i++) heights[i] = exp(-edges[i] * edges[i] / 2);
}

static double normal(void) {
  for (;;) {
    uint64_t word = bits();
    int layer = word & 255;
    double sign = word & 256 ? 1 : -1, x = (word >> 11) * 0x1p-53 * edges[layer];
    if (x < edges[layer + 1]) return sign * x;
    if (layer == 0) {
      do x = -log(1 - uniform()) / edges[1];
      while (-2 * log(1 - uniform()) <= x * x);
      return sign * (edges[1] + x);
    }
    if (heights[layer] + uniform() * (heights[layer + 1] - heights[layer]) < exp(-x * x / 2))
      return sign * x;
  }
}

static double limited(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

static void activate(double p, double v, int active[ACTIVE]) {
  const double width_p = 1.8 * TILINGS / (GRID * TILINGS - TILINGS + 1);
  const double width_v = 0.14 * TILINGS / (GRID * TILINGS - TILINGS + 1);
  for (int i = 0; i < TILINGS; i++) {
    double x = limited((p + 1.2) / width_p + i * (1.0 / TILINGS), 1e-4, GRID - 1e-4);
    double y = limited((v + 0.07) / width_v + i * (1.0 / TILINGS), 1e-4, GRID - 1e-4);
    active[i] = i * GRID * GRID + (int)x + GRID * (int)y;
  }
  active[TILINGS] = SIZE - 1;
}

static int move(double *p, double *v, double action) {
  double speed = *v + 0.001 * limited(action, -1, 1) - 0.0025 * cos(3 * *p);
  *v = limited(speed, -0.07, 0.07);
  *p += *v;
  if (*p < -1.2) *v = 0;
  *p = limited(*p, -1.2, 0.6);
  return *p >= 0.6;
}

static double dot(const double *weights, const int *active) {
  double total = 0;
  for (int i = 0; i < ACTIVE; i++) total += weights[active[i]];
  return total;
}

static void add(double *weights, const int *active, double amount) {
  for (int i = 0; i < ACTIVE; i++) weights[active[i]] += amount;
}

static int run(int stochastic, long steps) {
  static double first[SIZE], second[SIZE], value[SIZE];
  const double gamma = 0.99, alpha = 0.005 / ACTIVE, beta = stochastic ? 5e-6 / ACTIVE : 0.1 / ACTIVE;
  const double alpha_v = 0.1 / ACTIVE, width = 0.5;
  int active[ACTIVE], next[ACTIVE], length = 0;
  double p = -0.5, v = 0;
  memset(first, 0, sizeof first);
  memset(second, 0, sizeof second);
  memset(value, 0, sizeof value);
  activate(p, v, active);
  for (long t = 0; t < steps; t++) {
    double sigma = stochastic ? width * exp(dot(second, active)) + 1e-7 : width;
    double deviation = sigma * normal();
    int terminated = move(&p, &v, dot(first, active) + deviation);
    activate(p, v, next);
    double delta = -1 - dot(value, active) + (terminated ? 0 : gamma * dot(value, next));
    if (stochastic) {
      double variance = sigma * sigma;
      add(value, active, alpha_v * delta);
      add(first, active, alpha * delta * deviation / variance);
      add(second, active, beta * delta * (deviation * deviation / variance - 1));
    } else {
      double slope = dot(second, active);
      delta -= deviation * slope;
      add(first, active, alpha * slope);
      add(second, active, beta * delta * deviation);
      add(value, active, alpha_v * delta);
    }
    if (terminated || ++length == 5000) {
      p = -0.5, v = 0, length = 0;
      activate(p, v, active);
    } else {
      memcpy(active, next, sizeof active);
    }
  }
  return length;
}

int main(int count, char **words) {
  if (count != 4) return 2;
  int stochastic = !strcmp(words[1], "stochastic-ac"), last = 0;
  long steps = atol(words[2]), runs = atol(words[3]);
  struct timespec begun, ended;
  ziggurat();
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &begun);
  for (long seed = 1; seed <= runs; seed++) {
    for (int i = 0; i < 4; i++) stream[i] = seed * 0x9E3779B97F4A7C15u * (2 * i + 1);
    last = run(stochastic, steps);
  }
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &ended);
  double seconds = (ended.tv_sec - begun.tv_sec) + 1e-9 * (ended.tv_nsec - begun.tv_nsec);
  printf("%.6f %d\n", 1e9 * seconds / ((double)steps * runs), last);
  return 0;
}
