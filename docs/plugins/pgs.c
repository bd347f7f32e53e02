/* Projected Gauss-Seidel sweeps with relaxation, for every law: the solver SORprox(relaxation=...) in C.

   cc -O2 -shared -fPIC -I"$(python -m proxbench.solvers.native)" pgs.c -o libpgs.so -lm
   proxbench run --solver "Shared(./libpgs.so, options='relaxation=1.5')" */
#include "proxbench.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct {
    const pb_problem *problem;
    double *x, *old, *older, *best; /* impulses in padded blocks [N s]: now, one and two sweeps ago, the best */
    double *step;                   /* step size of each law [kg] */
} solver;

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double diagonal(const pb_problem *p, int row) {
    int w = (int)p->width, block = p->slot[row] / w, lane = p->slot[row] % w;
    return p->block_values[(int64_t)p->block_starts[block] * w * w + lane * w + lane];
}

static double velocity(const pb_problem *p, const double *x, int row) { /* row of G x + c */
    int w = (int)p->width, block = p->slot[row] / w, lane = p->slot[row] % w;
    double sum = p->free_velocity[row];
    for (int k = p->block_starts[block]; k < p->block_starts[block + 1]; k++) {
        const double *value = p->block_values + ((int64_t)k * w + lane) * w, *other = x + (int64_t)p->block_columns[k] * w;
        double part = 0.0;
        for (int m = 0; m < w; m++) part += value[m] * other[m];
        sum += part;
    }
    return sum;
}

static double radius(const pb_problem *p, const double *x, int law) {
    int partner = p->partner[law];
    return p->fixed_bound[law] + (partner < 0 ? 0.0 : p->friction[law] * fmax(x[p->slot[p->first_row[partner]]], 0.0));
}

static void sweep(solver *s) {
    const pb_problem *p = s->problem;
    double *kept = s->older;
    s->older = s->old, s->old = memcpy(kept, s->x, 8 * (size_t)(p->n_blocks * p->width));
    for (int law = 0; law < p->n_laws; law++) {
        double moved[3], squared = 0.0, bound = radius(p, s->x, law), scale = 1.0;
        for (int k = 0; k < p->row_count[law]; k++) {
            int row = p->first_row[law] + k;
            moved[k] = s->x[p->slot[row]] - s->step[law] * velocity(p, s->x, row);
            squared += moved[k] * moved[k];
        }
        if (p->set[law] == PB_HALF_LINE) moved[0] = fmax(moved[0], 0.0);
        if (p->set[law] == PB_BALL && squared > bound * bound) scale = bound / sqrt(squared);
        for (int k = 0; k < p->row_count[law]; k++) s->x[p->slot[p->first_row[law] + k]] = scale * moved[k];
    }
}

/* Return the residual, and at least what rounding hides of it: see PB_SCALES in proxbench.h. */
static double residual(const pb_problem *p, const double *x) {
    double largest = 0.0, hidden = 0.0;
    for (int law = 0; law < p->n_laws; law++) {
        double held[3], v[3], outside = 0.0, still = 0.0, apart = 0.0, bound = p->alpha[law] * radius(p, x, law);
        for (int k = 0; k < p->row_count[law]; k++) {
            int row = p->first_row[law] + k;
            held[k] = p->alpha[law] * x[p->slot[row]], v[k] = velocity(p, x, row);
            outside += (held[k] - v[k]) * (held[k] - v[k]), still += v[k] * v[k];
            hidden = fmax(hidden, p->weight[law] * fabs(diagonal(p, row) * x[p->slot[row]]));
        }
        for (int k = 0; k < p->row_count[law]; k++)
            apart += pow(held[k] - bound / sqrt(outside) * (held[k] - v[k]), 2.0);
        if (p->set[law] == PB_HALF_LINE) still = pow(fmin(held[0], v[0]), 2.0);
        if (p->set[law] == PB_BALL && outside > bound * bound) still = apart;
        if (!(p->weight[law] * sqrt(still) <= largest)) largest = p->weight[law] * sqrt(still);
    }
    return isnan(largest) ? INFINITY : fmax(largest, 2.2e-14 * hidden);
}

static int repeats(const solver *s) { /* whether the iterates are in a cycle of two */
    double size = 0.0, one = 0.0, two = 0.0;
    for (int64_t i = 0; i < s->problem->n_blocks * s->problem->width; i++) {
        size = fmax(size, fabs(s->x[i]));
        one = fmax(one, fabs(s->x[i] - s->old[i])), two = fmax(two, fabs(s->x[i] - s->older[i]));
    }
    return two <= 3.6e-15 * size && one > 3.6e-15 * size;
}

const pb_description *proxbench_describe(void) {
    static const pb_description about = {
        PB_INTERFACE, sizeof(pb_description), "pgs", "1.0", PB_COULOMB, 0, PB_BLOCKS | PB_SCALES, PB_ALL_LAWS,
        PB_SHOWS_ITERATES, 0};
    return &about;
}

int32_t proxbench_prepare(const pb_problem *p, const char *options, void **prepared, const char **message) {
    double relaxation = 1.0;
    if (*options && (sscanf(options, "relaxation=%lf", &relaxation) != 1 || !(relaxation > 0.0))) {
        *message = "write options='relaxation=1.5', a positive number";
        return PB_UNSUPPORTED;
    }
    size_t lanes = (size_t)(p->n_blocks * p->width) + 1;
    solver *s = *prepared = malloc(sizeof(solver));
    *s = (solver){p, calloc(lanes, 8), calloc(lanes, 8), calloc(lanes, 8), calloc(lanes, 8),
                  calloc((size_t)p->n_laws + 1, 8)};
    for (int law = 0; law < p->n_laws; law++) {
        double largest = 0.0;
        for (int k = 0; k < p->row_count[law]; k++) largest = fmax(largest, diagonal(p, p->first_row[law] + k));
        s->step[law] = largest > 0.0 ? relaxation / largest : 0.0;
    }
    return PB_SOLVED;
}

int32_t proxbench_solve(void *prepared, const pb_request *request, pb_result *result) {
    solver *s = prepared;
    const pb_problem *p = s->problem;
    size_t size = 8 * (size_t)(p->n_blocks * p->width);
    double end = seconds() + request->max_seconds, lowest = INFINITY, first = 1.0;
    int64_t done = 0, next = 0;
    int32_t status = p->infeasible_law < 0 ? -1 : PB_INFEASIBLE;
    for (int row = 0; row < p->n_rows; row++) s->x[p->slot[row]] = request->start[row];
    memcpy(s->best, s->x, size);
    while (status < 0) {
        double found = residual(p, s->x);
        if (done == 0) first = fmax(found, 1.0);
        if (found < lowest) lowest = found, memcpy(s->best, s->x, size);
        if (found <= request->tolerance) status = PB_SOLVED;
        else if (!(found < 1e8 * first)) status = PB_DIVERGED;
        else if (done > 2 && repeats(s)) status = PB_OSCILLATING;
        else if (done >= request->max_iterations) status = PB_ITERATION_LIMIT;
        else if (seconds() > end) status = PB_TIME_LIMIT;
        for (next = done + (done < 18 ? 1 + done / 2 : 10); status < 0 && done < next && done < request->max_iterations;) {
            sweep(s);
            done++;
            if (!request->observe) continue;
            for (int row = 0; row < p->n_rows; row++) result->impulses[row] = s->x[p->slot[row]];
            request->observe(request->context, done, result->impulses);
        }
    }
    for (int row = 0; row < p->n_rows; row++) result->impulses[row] = status == PB_INFEASIBLE ? 0.0 : s->best[p->slot[row]];
    result->iterations = done;
    return status;
}

void proxbench_free(void *prepared) {
    solver *s = prepared;
    free(s->x), free(s->old), free(s->older), free(s->best), free(s->step), free(s);
}
