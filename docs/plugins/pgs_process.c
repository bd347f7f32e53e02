/* The solver of pgs.c as an executable. Any solver with the functions of proxbench.h becomes an executable in this way.

   cc -O2 -I"$(python -m proxbench.solvers.native)" pgs_process.c pgs.c -o pgs -lm
   proxbench run --solver "Executable(./pgs)" */
#include "proxbench.h"
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { DESCRIBE = 1, PREPARE, SOLVE, ITERATE };

typedef struct {
    uint64_t length;
    uint32_t kind;
    int32_t code;
} head;

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void send(uint32_t kind, int32_t code, const void *numbers, size_t size, const double *x, int64_t n, const char *text) {
    text = text ? text : "";
    head h = {size + 8 * (uint64_t)n + strlen(text), kind, code};
    fwrite(&h, sizeof h, 1, stdout);
    fwrite(numbers, size, 1, stdout);
    fwrite(x, 8, (size_t)n, stdout);
    fwrite(text, strlen(text), 1, stdout);
}

static void show(void *context, int64_t iteration, const double *impulses) {
    send(ITERATE, 0, &iteration, 8, impulses, ((const pb_problem *)context)->n_rows, NULL);
}

int main(int count, char **arguments) {
    head h;
    char *body = NULL, *problem_body = NULL;
    void *prepared = NULL;
    pb_problem *problem = NULL;
    while (fread(&h, sizeof h, 1, stdin) == 1) {
        body = malloc(h.length + 8);
        if (fread(body, 1, h.length, stdin) != h.length) return 1;
        if (h.kind == DESCRIBE) {
            const pb_description *d = proxbench_describe();
            int32_t numbers[6] = {(int32_t)d->interface_version, d->model, d->sides, (int32_t)d->forms, (int32_t)d->laws,
                                  (int32_t)d->flags};
            char text[200];
            snprintf(text, sizeof text, "%s\n%s", d->name, d->version);
            send(DESCRIBE, 0, numbers, sizeof numbers, NULL, 0, text);
        } else if (h.kind == PREPARE) {
            if (prepared) proxbench_free(prepared);
            free(problem_body);
            prepared = NULL, problem_body = body, problem = (pb_problem *)body, body = NULL;
            char *pointer = problem_body + offsetof(pb_problem, free_velocity); /* offsets become addresses */
            for (; pointer < problem_body + sizeof(pb_problem); pointer += sizeof(char *)) {
                uintptr_t offset;
                memcpy(&offset, pointer, sizeof offset);
                char *address = offset ? problem_body + offset : NULL;
                memcpy(pointer, &address, sizeof address);
            }
            const char *message = NULL;
            double began = seconds();
            int32_t status = proxbench_prepare(problem, count > 1 ? arguments[1] : "", &prepared, &message);
            double spent = seconds() - began;
            send(PREPARE, status, &spent, 8, NULL, 0, message);
        } else {
            uint32_t flags[2]; /* threads, is_observed */
            memcpy(flags, body + 24, 8);
            pb_request request = {sizeof request, flags[0], 0.0, 0, 0.0, (const double *)(body + 32), flags[1] ? show : NULL,
                                  problem};
            memcpy(&request.tolerance, body, 8), memcpy(&request.max_seconds, body + 8, 8);
            memcpy(&request.max_iterations, body + 16, 8);
            pb_result result = {sizeof result, 0, calloc((size_t)problem->n_rows + 1, 8), 0, NULL};
            struct { int64_t iterations, n_rows; double seconds; } numbers = {0, problem->n_rows, seconds()};
            int32_t status = proxbench_solve(prepared, &request, &result);
            numbers.seconds = seconds() - numbers.seconds, numbers.iterations = result.iterations;
            send(SOLVE, status, &numbers, sizeof numbers, result.impulses, problem->n_rows, result.message);
            free(result.impulses);
        }
        fflush(stdout);
        free(body);
    }
    return 0;
}
