/* A solver that does what its options say: crash, hang, lie, write too much or too little. */
#include "proxbench.h"
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef VERSION
#define VERSION PB_INTERFACE
#endif
#ifndef MODEL
#define MODEL PB_COULOMB
#endif

typedef struct {
    const pb_problem *problem;
    char fault[40];
} solver;

const pb_description *proxbench_describe(void) {
    static const pb_description about = {VERSION, sizeof(pb_description), "faulty", "0.1", MODEL, 0, PB_DENSE,
                                         PB_CONTACTS | PB_PLANAR_FRICTION | PB_SPATIAL_FRICTION, PB_SHOWS_ITERATES, 0};
    return &about;
}

int32_t proxbench_prepare(const pb_problem *problem, const char *options, void **prepared, const char **message) {
    if (!strcmp(options, "refuse")) {
        *message = "it is not in the mood";
        return PB_UNSUPPORTED;
    }
    solver *s = *prepared = calloc(1, sizeof(solver));
    s->problem = problem;
    snprintf(s->fault, sizeof s->fault, "%s", options);
    return PB_SOLVED;
}

int32_t proxbench_solve(void *prepared, const pb_request *request, pb_result *result) {
    solver *s = prepared;
    int64_t n = s->problem->n_rows;
    const char *fault = s->fault;
    for (int64_t i = 0; i < n; i++) result->impulses[i] = request->start[i];
    result->iterations = (int64_t)request->threads;
    if (!strcmp(fault, "crash")) raise(SIGSEGV);
    if (!strcmp(fault, "exit")) exit(7);
    if (!strcmp(fault, "license")) {
        fprintf(stderr, "checking\nlicense \033expired\n\n");
        exit(4);
    }
    if (!strcmp(fault, "hang")) for (;;) result->iterations = 0;
    if (!strcmp(fault, "lie")) return PB_SOLVED;
    if (!strcmp(fault, "overrun")) result->impulses[n] = 1.0;
    if (!strcmp(fault, "underrun")) result->impulses[-1] = 1.0;
    if (!strcmp(fault, "short")) result->impulses[n - 1] = NAN;
    if (!strcmp(fault, "status")) return 99;
    if (!strcmp(fault, "count")) result->iterations = -1;
    if (!strcmp(fault, "write")) memset((void *)(uintptr_t)s->problem->free_velocity, 0, 8 * (size_t)n);
    if (!strcmp(fault, "observe"))
        for (int64_t i = 1; i <= 3; i++) request->observe(request->context, i, result->impulses);
    if (!strcmp(fault, "limit")) {
        result->message = "the limit \x1b[31mwas\n small";
        return PB_ITERATION_LIMIT;
    }
    return PB_SOLVED;
}

#ifndef WITHOUT_FREE
void proxbench_free(void *prepared) {
    free(prepared);
}
#endif
