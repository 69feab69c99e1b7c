/* A host in C for a library of FMI 2.0 co-simulation, for Windows: replay LIBRARY GUID TOLERANCE INPUTS OUTPUTS.
 * INPUTS and OUTPUTS are value references of reals, separated by commas. A row on the standard input is a time and the
 * inputs that hold from there on; for each, a row with the time and the outputs goes to the standard output. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <windows.h>

enum { MOST = 100 };

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} Callbacks;

static void logger(void *environment, const char *instance, int status, const char *category, const char *message, ...)
{
    (void)environment, (void)category;
    va_list rest;
    va_start(rest, message);
    fprintf(stderr, "%s, status %d: ", instance, status);
    vfprintf(stderr, message, rest);
    fputc('\n', stderr);
    va_end(rest);
}

static HMODULE library;

static void *function(const char *name)
{
    void *address = (void *)GetProcAddress(library, name);
    if (!address) {
        fprintf(stderr, "no %s\n", name);
        exit(1);
    }
    return address;
}

static void check(const char *name, int status)
{
    if (status > 1) {
        fprintf(stderr, "%s: status %d\n", name, status);
        exit(1);
    }
}

static size_t references(char *text, unsigned *list)
{
    size_t count = 0;
    for (char *end; *text && count < MOST; text = *end == ',' ? end + 1 : end)
        list[count++] = strtoul(text, &end, 10);
    return count;
}

int main(int count, char **arguments)
{
    if (count != 6)
        return 2;
    library = LoadLibraryA(arguments[1]);
    if (!library) {
        fprintf(stderr, "%s: error %lu\n", arguments[1], GetLastError());
        return 1;
    }
    void *(*instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int) =
        function("fmi2Instantiate");
    int (*setup)(void *, int, double, double, int, double) = function("fmi2SetupExperiment");
    int (*enter)(void *) = function("fmi2EnterInitializationMode");
    int (*leave)(void *) = function("fmi2ExitInitializationMode");
    int (*set)(void *, const unsigned *, size_t, const double *) = function("fmi2SetReal");
    int (*get)(void *, const unsigned *, size_t, double *) = function("fmi2GetReal");
    int (*step)(void *, double, double, int) = function("fmi2DoStep");
    int (*terminate)(void *) = function("fmi2Terminate");
    void (*release)(void *) = function("fmi2FreeInstance");

    unsigned inputs[MOST], outputs[MOST];
    size_t given = references(arguments[4], inputs), asked = references(arguments[5], outputs);
    Callbacks callbacks = {logger, calloc, free, NULL, NULL};
    void *rod = instantiate("rod", 1, arguments[2], "", &callbacks, 0, 0);
    if (!rod)
        return 1;
    check("fmi2SetupExperiment", setup(rod, 1, atof(arguments[3]), 0, 0, 0));
    check("fmi2EnterInitializationMode", enter(rod));

    double time = 0, next, values[MOST];
    for (int row = 0; scanf("%lf", &next) == 1; row++) {
        if (row > 0)
            check("fmi2DoStep", step(rod, time, next - time, 1));
        time = next;
        for (size_t k = 0; k < given; k++)
            if (scanf(",%lf", &values[k]) != 1)
                return 1;
        check("fmi2SetReal", set(rod, inputs, given, values));
        if (row == 0)
            check("fmi2ExitInitializationMode", leave(rod));
        check("fmi2GetReal", get(rod, outputs, asked, values));
        printf("%.17g", time);
        for (size_t k = 0; k < asked; k++)
            printf(",%.17g", values[k]);
        printf("\n");
    }
    check("fmi2Terminate", terminate(rod));
    release(rod);
    return !FreeLibrary(library);
}
