/* proxbench.h: a contact solver for Proxbench in C, or in any language with a C interface.

   Find the impulses x [N s] with  -(G x + c)_i in N_C(x_i)  for every law i, where C is a half-line, a line, or a ball of
   radius  fixed_bound + friction * max(x[first_row[partner]], 0).

   A shared library exports the four functions at the end of this page. They are called from one thread.

       cc -O2 -shared -fPIC -I"$(python -m proxbench.solvers.native)" mine.c -o libmine.so
       proxbench run --solver "Shared(./libmine.so)"

   Matrices and vectors are plain arrays: int32_t indices from 0, doubles, rows one after the other. */
#ifndef PROXBENCH_H
#define PROXBENCH_H
#include <stdint.h>

#define PB_INTERFACE 1 /* version of this page; structures only grow at their ends within a version */

enum pb_status { /* how a solve ended */
    PB_SOLVED, PB_ITERATION_LIMIT, PB_TIME_LIMIT, PB_STALLED, PB_OSCILLATING, PB_DIVERGED, PB_INFEASIBLE, PB_UNSUPPORTED
};
enum pb_model { PB_COULOMB, PB_CONVEX, PB_PYRAMID, PB_FRICTIONLESS }; /* what is solved; the judge tests that model */
enum pb_set { PB_HALF_LINE, PB_LINE, PB_BALL };                       /* contact, joint, friction */

enum pb_form { /* arrays that the solver asks for; others are NULL */
    PB_SCALES = 1, PB_DENSE = 2, PB_SPARSE = 4, PB_BLOCKS = 8, PB_FACTORS = 16 /* PB_FACTORS: if the problem has them */
};
enum pb_laws { /* laws that the solver supports */
    PB_CONTACTS = 1, PB_JOINTS = 2, PB_PLANAR_FRICTION = 4, PB_SPATIAL_FRICTION = 8, PB_ROLLING_FRICTION = 16,
    PB_OTHER_BOUNDS = 32, /* fixed_bound > 0, or friction bounded by a contact that it does not follow */
    PB_ASYMMETRIC = 64,   /* G differs from its transpose */
    PB_ALL_LAWS = 127
};
enum pb_flags { PB_SHOWS_ITERATES = 1, PB_IS_RANDOMISED = 2 };

typedef struct {
    uint32_t interface_version, size; /* PB_INTERFACE, sizeof(pb_description) */
    const char *name, *version;
    int32_t model, sides;             /* pb_model, sides of the pyramid */
    uint32_t forms, laws, flags, reserved;
} pb_description;

typedef struct {
    uint32_t size, forms;          /* sizeof(pb_problem), the forms that are present */
    int64_t n_rows, n_laws, n_dofs, n_blocks, width;
    int64_t infeasible_law;        /* a law that no impulses satisfy, or -1 [PB_SCALES] */
    const double *free_velocity;   /* c [m/s]                                   [n_rows] */
    const int32_t *set, *row_count, *first_row;                              /* [n_laws] */
    const double *friction, *fixed_bound; /* mu, a [N s]                        [n_laws] */
    const int32_t *partner;        /* law whose impulse bounds this one, or -1  [n_laws] */
    /* PB_SCALES: the residual is max_i weight_i ||alpha_i x_i - P(alpha_i x_i - v_i)||, v = G x + c, P onto alpha_i C */
    const double *alpha, *weight;  /* [1/kg], [s/m]                             [n_laws] */
    const double *dense;           /* PB_DENSE: G [1/kg]               [n_rows * n_rows] */
    /* PB_SPARSE: row r of G has columns[k] and values[k], row_starts[r] <= k < row_starts[r + 1], columns ascending */
    const int32_t *row_starts, *columns;
    const double *values, *diagonal; /* and the diagonal of G                   [n_rows] */
    /* PB_BLOCKS: blocks of width * width; row b holds the blocks k from block_starts[b] to block_starts[b + 1], the
       diagonal one first. Row r of the problem is lane slot[r] % width of block slot[r] / width; other lanes are zero. */
    const int32_t *block_starts, *block_columns;
    const double *block_values;
    const int32_t *slot;           /*                                           [n_rows] */
    /* PB_FACTORS: G = W^T M^-1 W. Column r of W has w_dofs[k], w_values[k], w_starts[r] <= k < w_starts[r + 1]; M^-1 is
       block diagonal, its rows as those of PB_SPARSE; free_motion is the velocity without contacts, NULL if unknown. */
    const int32_t *w_starts, *w_dofs;
    const double *w_values;
    const int32_t *mass_starts, *mass_columns;
    const double *mass_values, *free_motion;
} pb_problem;

typedef struct {
    uint32_t size, threads;        /* sizeof(pb_request), number of threads that the solver may use */
    double tolerance;              /* the residual to reach */
    int64_t max_iterations;
    double max_seconds;
    const double *start;           /* where to begin, zeros by default          [n_rows] */
    void (*observe)(void *context, int64_t iteration, const double *impulses); /* NULL, or call after each iteration */
    void *context;
} pb_request;

typedef struct {
    uint32_t size, reserved;
    double *impulses;              /* to be written: the best finite iterate    [n_rows] */
    int64_t iterations;
    const char *message;           /* NULL, or the reason for the status */
} pb_result;

#ifdef _WIN32
#define PB_EXPORT __declspec(dllexport)
#else
#define PB_EXPORT __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

PB_EXPORT const pb_description *proxbench_describe(void);

/* Do the work that depends on the problem alone. Return PB_SOLVED, or a status and a message. The arrays stay as they
   are until proxbench_free; options is the text of Shared(./libmine.so, options='...'), "" by default. */
PB_EXPORT int32_t proxbench_prepare(const pb_problem *problem, const char *options, void **prepared,
                                    const char **message);

/* Solve once, from request->start; return a pb_status. A message stays valid until the next call. */
PB_EXPORT int32_t proxbench_solve(void *prepared, const pb_request *request, pb_result *result);

PB_EXPORT void proxbench_free(void *prepared);

#ifdef __cplusplus
}
#endif
#endif
