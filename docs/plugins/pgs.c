/* Projected Gauss-Seidel sweeps with relaxation, for all laws: the solver SORprox(relaxation=...) in C.

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
    double *x, *seen, *step; /* current impulses, those at the last check [N s], step size of each law [kg] */
} solver;

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Write P(scale x - weight (G x + c)) of one law into y, where P projects onto scale times its set. */
static void project(const pb_problem *p, int law, double scale, double weight, const double *x, double *y) {
    double bound = p->fixed_bound[law], squared = 0.0;
    if (p->partner[law] >= 0) bound += p->friction[law] * fmax(x[p->first_row[p->partner[law]]], 0.0);
    for (int k = 0, row = p->first_row[law]; k < p->row_count[law]; k++, row++) {
        double velocity = p->free_velocity[row];
        for (int n = p->row_starts[row]; n < p->row_starts[row + 1]; n++) velocity += p->values[n] * x[p->columns[n]];
        y[k] = scale * x[row] - weight * velocity;
        squared += y[k] * y[k];
    }
    if (p->set[law] == PB_HALF_LINE) y[0] = fmax(y[0], 0.0);
    if (p->set[law] == PB_BALL && squared > scale * scale * bound * bound)
        for (int k = 0; k < p->row_count[law]; k++) y[k] *= scale * bound / sqrt(squared);
}

/* Return the residual, or its rounding error if that is larger; see PB_SCALES in proxbench.h. */
static double residual(const pb_problem *p, const double *x) {
    double largest = 0.0, hidden = 0.0;
    for (int law = 0; law < p->n_laws; law++) {
        double y[3], squared = 0.0;
        project(p, law, p->alpha[law], 1.0, x, y);
        for (int k = 0, row = p->first_row[law]; k < p->row_count[law]; k++, row++) {
            squared += pow(p->alpha[law] * x[row] - y[k], 2.0);
            hidden = fmax(hidden, p->weight[law] * fabs(p->diagonal[row] * x[row]));
        }
        if (!(p->weight[law] * sqrt(squared) <= largest)) largest = p->weight[law] * sqrt(squared);
    }
    return isnan(largest) ? INFINITY : fmax(largest, 2.2e-14 * hidden);
}

const pb_description *proxbench_describe(void) {
    static const pb_description about = {PB_INTERFACE, sizeof(pb_description), "pgs", "1.0", PB_COULOMB, 0,
                                         PB_SPARSE | PB_SCALES, PB_ALL_LAWS, PB_SHOWS_ITERATES, 0};
    return &about;
}

int32_t proxbench_prepare(const pb_problem *p, const char *options, void **prepared, const char **message) {
    double relaxation = 1.0;
    if (*options && (sscanf(options, "relaxation=%lf", &relaxation) != 1 || !(relaxation > 0.0))) {
        *message = "write options='relaxation=1.5', a positive number";
        return PB_UNSUPPORTED;
    }
    solver *s = *prepared = malloc(sizeof(solver));
    size_t rows = (size_t)p->n_rows + 1;
    *s = (solver){p, calloc(rows, 8), calloc(rows, 8), calloc((size_t)p->n_laws + 1, 8)};
    for (int law = 0; law < p->n_laws; law++) {
        double largest = 0.0;
        for (int k = 0; k < p->row_count[law]; k++) largest = fmax(largest, p->diagonal[p->first_row[law] + k]);
        s->step[law] = largest > 0.0 ? relaxation / largest : 0.0;
    }
    return PB_SOLVED;
}

int32_t proxbench_solve(void *prepared, const pb_request *request, pb_result *result) {
    const solver *s = prepared;
    const pb_problem *p = s->problem;
    double end = seconds() + request->max_seconds, lowest = INFINITY, first = 1.0, y[3];
    int64_t done = 0, next = 0; /* sweeps done, and sweep of the next residual check */
    size_t size = 8 * (size_t)p->n_rows;
    memset(result->impulses, 0, size);
    if (p->infeasible_law >= 0) return PB_INFEASIBLE;
    for (memcpy(s->x, request->start, size);; done++) {
        if (done == next || done >= request->max_iterations) {
            double found = residual(p, s->x);
            result->iterations = done, next += done < 18 ? 1 + done / 2 : 10;
            if (done == 0) first = fmax(found, 1.0);
            if (found < lowest) lowest = found, memcpy(result->impulses, s->x, size);
            if (found <= request->tolerance) return PB_SOLVED;
            if (!(found < 1e8 * first)) return PB_DIVERGED;
            if (done > 18 && memcmp(s->seen, s->x, size) == 0) return PB_OSCILLATING; /* ten sweeps change nothing */
            if (done >= request->max_iterations) return PB_ITERATION_LIMIT;
            if (seconds() > end) return PB_TIME_LIMIT;
            memcpy(s->seen, s->x, size);
        }
        for (int law = 0; law < p->n_laws; law++) { /* a sweep */
            project(p, law, 1.0, s->step[law], s->x, y);
            memcpy(s->x + p->first_row[law], y, 8 * (size_t)p->row_count[law]);
        }
        if (request->observe) request->observe(request->context, done + 1, s->x);
    }
}

void proxbench_free(void *prepared) {
    const solver *s = prepared;
    free(s->x), free(s->seen), free(s->step), free(prepared);
}
