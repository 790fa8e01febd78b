/* A PD controller of N joints as a co-simulation unit of FMI 2.0, written by hand and with no code of mbexport.

   References: block b of joint i is b * N + i; blocks: q, dq, q_cmd, dq_cmd, tau, kp, kd, fault.
   It samples: the torque is of the inputs at the beginning of a step. fault_1 of 1 fails a step, of 2 gives no number. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef void *Component;
typedef unsigned int Reference;
typedef const char *Text;
typedef struct {
    void (*logger)(void *, Text, int, Text, Text, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} Callbacks;

enum { Q, DQ, Q_CMD, DQ_CMD, TAU, KP, KD, FAULT, BLOCKS };
enum { OK, WARNING, DISCARD, ERROR };

typedef struct {
    double values[BLOCKS * N];
    int stepping;
    Callbacks callbacks;
} Unit;

#define EXPORT __attribute__((visibility("default")))
#define VALUE(unit, block, i) (unit)->values[(block) * N + (i)]

static void law(Unit *unit) {
    for (int i = 0; i < N; i++)
        VALUE(unit, TAU, i) = VALUE(unit, KP, i) * (VALUE(unit, Q_CMD, i) - VALUE(unit, Q, i)) +
                              VALUE(unit, KD, i) * (VALUE(unit, DQ_CMD, i) - VALUE(unit, DQ, i));
}

EXPORT Component fmi2Instantiate(Text name, int kind, Text guid, Text place, const Callbacks *calls, int a, int b) {
    (void)name, (void)kind, (void)place, (void)a, (void)b;
    if (strcmp(guid, GUID)) {
        calls->logger(calls->environment, name, ERROR, "error", "guid %s is not mine", guid);
        return NULL;
    }
    Unit *unit = calls->allocate(1, sizeof(Unit));
    unit->callbacks = *calls;
    for (int i = 0; i < N; i++) VALUE(unit, KP, i) = 40.0, VALUE(unit, KD, i) = 3.0;
    return unit;
}
EXPORT void fmi2FreeInstance(Component c) { ((Unit *)c)->callbacks.release(c); }
EXPORT int fmi2ExitInitializationMode(Component c) { ((Unit *)c)->stepping = 1; return OK; }
EXPORT int fmi2SetReal(Component c, const Reference r[], size_t n, const double v[]) {
    for (size_t k = 0; k < n; k++) ((Unit *)c)->values[r[k]] = v[k];
    return OK;
}
EXPORT int fmi2GetReal(Component c, const Reference r[], size_t n, double v[]) {
    Unit *unit = c;
    if (!unit->stepping) law(unit);
    for (size_t k = 0; k < n; k++) v[k] = unit->values[r[k]];
    return OK;
}
EXPORT int fmi2DoStep(Component c, double t, double h, int a) {
    Unit *unit = c;
    (void)h, (void)a;
    if (VALUE(unit, FAULT, 0) == 1.0 && t > 0.005) {
        unit->callbacks.logger(unit->callbacks.environment, "pd", ERROR, "error", "too hot at %g s", t);
        return ERROR;
    }
    law(unit);
    if (VALUE(unit, FAULT, 0) == 2.0) VALUE(unit, TAU, 0) = NAN;
    return OK;
}

/* the rest of the interface, which a controller has no use for */
EXPORT Text fmi2GetTypesPlatform(void) { return "default"; }
EXPORT Text fmi2GetVersion(void) { return "2.0"; }
#define NOTHING(name, ...) EXPORT int name(__VA_ARGS__) { return OK; }
#define REFUSED(name, ...) EXPORT int name(__VA_ARGS__) { return ERROR; }
NOTHING(fmi2SetDebugLogging, Component c, int on, size_t n, const Text names[])
NOTHING(fmi2SetupExperiment, Component c, int a, double b, double d, int e, double f)
NOTHING(fmi2EnterInitializationMode, Component c)
NOTHING(fmi2Terminate, Component c)
NOTHING(fmi2Reset, Component c)
NOTHING(fmi2CancelStep, Component c)
REFUSED(fmi2GetInteger, Component c, const Reference r[], size_t n, int v[])
REFUSED(fmi2GetBoolean, Component c, const Reference r[], size_t n, int v[])
REFUSED(fmi2GetString, Component c, const Reference r[], size_t n, Text v[])
REFUSED(fmi2SetInteger, Component c, const Reference r[], size_t n, const int v[])
REFUSED(fmi2SetBoolean, Component c, const Reference r[], size_t n, const int v[])
REFUSED(fmi2SetString, Component c, const Reference r[], size_t n, const Text v[])
REFUSED(fmi2GetFMUstate, Component c, void **s)
REFUSED(fmi2SetFMUstate, Component c, void *s)
REFUSED(fmi2FreeFMUstate, Component c, void **s)
REFUSED(fmi2SerializedFMUstateSize, Component c, void *s, size_t *n)
REFUSED(fmi2SerializeFMUstate, Component c, void *s, char b[], size_t n)
REFUSED(fmi2DeSerializeFMUstate, Component c, const char b[], size_t n, void **s)
REFUSED(fmi2GetDirectionalDerivative, Component c, const Reference u[], size_t m, const Reference k[], size_t n,
        const double d[], double r[])
REFUSED(fmi2SetRealInputDerivatives, Component c, const Reference r[], size_t n, const int o[], const double v[])
REFUSED(fmi2GetRealOutputDerivatives, Component c, const Reference r[], size_t n, const int o[], double v[])
REFUSED(fmi2GetStatus, Component c, int k, int *v)
REFUSED(fmi2GetRealStatus, Component c, int k, double *v)
REFUSED(fmi2GetIntegerStatus, Component c, int k, int *v)
REFUSED(fmi2GetBooleanStatus, Component c, int k, int *v)
REFUSED(fmi2GetStringStatus, Component c, int k, Text *v)
