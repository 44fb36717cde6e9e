/* An emulated libHD.so: the symbols of the maker's HD library that the driver uses, with up to two emulated Omnis.
 *
 *   cc -shared -fPIC -O2 -pthread -o libHD.so emulated_hd.c
 *
 * It is strict where users report that the real one is: state is read and written between hdBeginFrame and hdEndFrame
 * and in the servo thread alone, calibration acts there alone (and takes any pose for the inkwell), the first frames
 * after the start of the scheduler are errors, and a name that the configuration does not know is refused. A torque
 * acts until the next one, whatever becomes of the program: the worst that a device could do.
 *
 * Symbols that begin with em_ belong to the emulation. Stepped (em_stepped): time goes on by em_tick alone, and
 * em_clock_gettime tells that time. Otherwise a thread ticks once a millisecond. EM_CONFIG, where it is set, names
 * the devices of the configuration, with a comma between them; EM_MOVES has a hand hold each, instead of nothing.
 * EM_MOVES=doctor: a hand that does what `doctor --omni` asks for, and presses button 1 each time. */
#define _GNU_SOURCE
#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef unsigned int HHD, HDenum, HDerror, HDCallbackCode;
typedef unsigned long HDulong;
typedef HDCallbackCode (*Callback)(void *);
typedef struct { HDerror code; int internal; HHD device; } HDErrorInfo;

enum { DEVICES = 2, CALLBACKS = 8, ERRORS = 16, UNSETTLED = 2 };
#define BAD_HANDLE 0xFFFFFFFFu
#define TICK 1000000L

typedef struct {
    char name[64], serial[32], model[32];
    int open, force, calibration, style, inkwell, buttons, unplugged, without_temperature, moves;
    long calibrated; /* periods since then */
    double offset[3], angles[3], gimbal[3], torque[3], temperature, speed[3];
} Device;

static Device devices[DEVICES];
static struct { Callback call; void *data; unsigned short priority; HDulong handle; } scheduled[CALLBACKS];
static struct { Callback call; void *data; int waiting, done; } synchronous;
static HDErrorInfo errors[ERRORS];
static int error_count, running, stepped, in_frame = -1, refusal, clean;
static HHD current = BAD_HANDLE;
static HDulong next_handle = 1;
static int dead; /* the servo thread hangs: whoever waits for it waits for ever */
static long updates, ticks, stall_ns, frames, outside;
static pthread_t servo;
enum { MEASURED = 65536 };
static double held[MEASURED]; /* us for which the callbacks held the servo thread, of the last periods */
static long begun;
static __thread int servo_thread;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t changed = PTHREAD_COND_INITIALIZER;
static int set_up;
static const double start[3] = {0.0, 0.908, 1.128};

static void fail(HDerror code, int internal) {
    if (error_count < ERRORS) errors[error_count++] = (HDErrorInfo){code, internal, current};
}
static Device *device_of(HHD handle) { return handle < DEVICES && devices[handle].open ? &devices[handle] : NULL; }

/* ---- the emulation's own symbols ---- */

void em_reset(void) {
    memset(devices, 0, sizeof devices);
    memset(scheduled, 0, sizeof scheduled);
    error_count = running = refusal = clean = 0;
    in_frame = -1;
    current = BAD_HANDLE;
    dead = 0;
    updates = stall_ns = frames = outside = ticks = 0;
    const char *names[DEVICES] = {"Default Device", "Second Device"};
    for (int i = 0; i < DEVICES; i++) {
        strcpy(devices[i].name, names[i]);
        snprintf(devices[i].serial, sizeof devices[i].serial, "EM%04d", i + 1);
        strcpy(devices[i].model, "Emulated Omni");
        devices[i].calibration = 0x5001;
        devices[i].style = 4;
        devices[i].inkwell = 1;
        const char *moves = getenv("EM_MOVES");
        devices[i].moves = moves == NULL ? 0 : strcmp(moves, "doctor") == 0 ? 2 : 1;
        memcpy(devices[i].angles, start, sizeof start);
        devices[i].offset[0] = 0.31 + i; devices[i].offset[1] = -0.22; devices[i].offset[2] = 0.13;
    }
    const char *config = getenv("EM_CONFIG");
    if (config != NULL) {
        char text[160];
        snprintf(text, sizeof text, "%s", config);
        char *rest = text;
        for (int i = 0; i < DEVICES; i++) {
            char *name = strsep(&rest, ",");
            snprintf(devices[i].name, sizeof devices[i].name, "%s", name != NULL ? name : "");
        }
    }
    set_up = 1;
}
static void ready(void) { if (!set_up) em_reset(); }

void em_stepped(int on) { stepped = on; }
void em_rename(int i, const char *name) { snprintf(devices[i].name, 64, "%s", name); }
void em_refuse(HDerror code) { refusal = (int)code; }
void em_angles(int i, const double *angles) { memcpy(devices[i].angles, angles, sizeof devices[i].angles); }
void em_true_angles(int i, double *angles) { memcpy(angles, devices[i].angles, sizeof devices[i].angles); }
void em_torque(int i, double *torque) { for (int k = 0; k < 3; k++) torque[k] = 1e-3 * devices[i].torque[k]; }
int em_force(int i) { return devices[i].force; }
void em_left_on(int i) { /* force is on, and a torque acts that no frame of this program has asked for */
    devices[i].force = 1;
    for (int k = 0; k < 3; k++) devices[i].torque[k] = 50.0;
}
int em_is_open(int i) { return devices[i].open; }
void em_inkwell(int i, int in) { devices[i].inkwell = in; }
void em_uncalibrate(int i) { devices[i].calibration = 0x5001; }
void em_buttons(int i, int buttons) { devices[i].buttons = buttons; }
void em_unplug(int i, int gone) {
    devices[i].unplugged = gone;
    if (gone) memset(devices[i].torque, 0, sizeof devices[i].torque), devices[i].force = 0;
}
void em_temperature(int i, double value) { devices[i].temperature = value; }
void em_without_temperature(int i) { devices[i].without_temperature = 1; }
void em_error(HDerror code, int internal) { fail(code, internal); }
void em_stall(double seconds) { stall_ns = (long)(1e9 * seconds); }
void em_late(int periods) { ticks += periods; }
void em_dead(int on) { dead = on; }
void em_nameless(int i) { devices[i].serial[0] = devices[i].model[0] = '\0'; }
void em_numberless(int i) { devices[i].serial[0] = 0; }
void em_moves(int i, int on) { devices[i].moves = on; }
long em_ticks(void) { return ticks; }
long em_frames(void) { return frames; }
long em_outside(void) { return outside; }
int em_scheduled(void) {
    int n = 0;
    for (int i = 0; i < CALLBACKS; i++) n += scheduled[i].call != NULL;
    return n;
}
long em_begun(void) { return begun; } /* ns, when the last period began */
void em_held(double *out, int n) {
    for (int i = 0; i < n; i++) out[i] = held[(ticks - n + i + MEASURED) % MEASURED];
}
long em_updates(void) { return updates; }
int em_running(void) { return running; }

int em_clock_gettime(int which, struct timespec *now) {
    if (!stepped) return clock_gettime(which, now);
    now->tv_sec = ticks / 1000;
    now->tv_nsec = (ticks % 1000) * TICK;
    return 0;
}

/* The last word: what acted when the process ended, for a file that EM_LOG names. */
__attribute__((destructor)) static void say_goodbye(void) {
    const char *name = getenv("EM_LOG");
    FILE *file = name != NULL ? fopen(name, "w") : NULL;
    if (file == NULL) return;
    for (int i = 0; i < DEVICES; i++)
        fprintf(file, "%d %d %g %g %g\n", devices[i].open, devices[i].force, devices[i].torque[0], devices[i].torque[1],
                devices[i].torque[2]);
    fclose(file);
}

/* ---- one period ---- */

enum { POSE = 1500, MOVED = 500, PRESSED = 1200, LET_GO = 1300 };

/* Where the hand wants axis k: in the first pose at the start, then left, up and out by 20 degrees, one after another. */
static double wanted(Device *d, int k) {
    double share = d->moves == 2 ? (d->calibrated - (k + 1.0) * POSE) / MOVED : 0.0;
    return start[k] + 0.35 * (share < 0.0 ? 0.0 : share > 1.0 ? 1.0 : share);
}

static void live(Device *d) {
    if (d->calibration == 0x5000) d->calibrated++;
    if (d->moves == 2) {
        long into = d->calibrated % POSE;
        d->buttons = d->calibrated < 4 * POSE && into >= PRESSED && into < LET_GO;
    }
    /* About the real device's inertia, in a hand that holds it where it began. Ends of the range stop it. */
    static const double inertia[3] = {2.5e-3, 2.5e-3, 6.5e-4}, damping = 0.05, hand = 0.5;
    for (int k = 0; d->moves && k < 3; k++) {
        double tau = 1e-3 * d->torque[k] - damping * d->speed[k] - hand * (d->angles[k] - wanted(d, k));
        d->speed[k] += 1e-3 * tau / inertia[k];
        d->angles[k] += 1e-3 * d->speed[k];
        double low = k == 0 ? -0.98 : 0.03, high = k == 0 ? 0.98 : 1.95;
        if (d->angles[k] < low) d->angles[k] = low, d->speed[k] = 0.0;
        if (d->angles[k] > high) d->angles[k] = high, d->speed[k] = 0.0;
    }
}

static long nanoseconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return 1000000000L * now.tv_sec + now.tv_nsec;
}

void em_tick(void) {
    int was = servo_thread;
    servo_thread = 1;
    pthread_mutex_lock(&lock);
    for (int i = 0; i < DEVICES; i++)
        if (devices[i].open) live(&devices[i]);
    long at = ticks++;
    clean++;
    begun = nanoseconds();
    pthread_mutex_unlock(&lock);
    for (int i = 0; i < CALLBACKS; i++) {
        Callback call = scheduled[i].call;
        if (call != NULL && call(scheduled[i].data) == 0) scheduled[i].call = NULL;
    }
    pthread_mutex_lock(&lock);
    if (synchronous.waiting) {
        Callback call = synchronous.call;
        pthread_mutex_unlock(&lock);
        call(synchronous.data);
        pthread_mutex_lock(&lock);
        synchronous.waiting = 0;
        synchronous.done = 1;
        pthread_cond_broadcast(&changed);
    }
    held[at % MEASURED] = 1e-3 * (double)(nanoseconds() - begun);
    pthread_mutex_unlock(&lock);
    servo_thread = was;
}

static void *serve(void *unused) {
    (void)unused;
    struct timespec due;
    clock_gettime(CLOCK_MONOTONIC, &due);
    struct sched_param high = {.sched_priority = 30};
    pthread_setschedparam(pthread_self(), SCHED_FIFO, &high); /* where permitted, as the real one asks for */
    while (running) {
        due.tv_nsec += TICK + stall_ns;
        stall_ns = 0;
        while (due.tv_nsec >= 1000000000L) due.tv_nsec -= 1000000000L, due.tv_sec++;
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        em_tick();
    }
    return NULL;
}

/* ---- the maker's symbols ---- */

HHD hdInitDevice(const char *name) {
    ready();
    if (refusal) { fail((HDerror)refusal, 0); return BAD_HANDLE; }
    for (HHD i = 0; i < DEVICES; i++) {
        if (name == NULL || devices[i].name[0] == '\0' || strcmp(name, devices[i].name) != 0) continue;
        if (devices[i].unplugged) { fail(0x0302, -28); return BAD_HANDLE; }
        if (devices[i].open) { fail(0x0301, 0); return BAD_HANDLE; }
        devices[i].open = 1;
        devices[i].calibration = 0x5001;
        devices[i].calibrated = 0;
        current = i;
        return i;
    }
    fail(0x0303, 0);
    return BAD_HANDLE;
}

void hdDisableDevice(HHD handle) {
    Device *d = device_of(handle);
    if (d == NULL) { fail(0x0104, 0); return; }
    d->open = d->force = 0; /* what acted acts on, unless it was taken away before */
    if (current == handle) current = BAD_HANDLE;
}

HHD hdGetCurrentDevice(void) { return current; }
void hdMakeCurrentDevice(HHD handle) {
    if (device_of(handle) == NULL) { fail(0x0104, 0); return; }
    current = handle;
}

void hdBeginFrame(HHD handle) {
    if (!servo_thread) { outside++; fail(0x0400, 0); return; }
    if (device_of(handle) == NULL) { fail(0x0104, 0); return; }
    if (in_frame >= 0) { fail(0x0400, 0); return; }
    current = handle;
    in_frame = (int)handle;
}

void hdEndFrame(HHD handle) {
    Device *d = device_of(handle);
    if (in_frame != (int)handle || d == NULL || clean <= UNSETTLED) { in_frame = -1; fail(0x0401, 0); return; }
    in_frame = -1;
    frames++;
    if (d->unplugged) { fail(0x0302, -28); return; }
    if (d->force && d->temperature >= 1.0) { memset(d->torque, 0, sizeof d->torque); fail(0x0200, 0); }
}

static int outside_frame(void) {
    if (in_frame >= 0 && servo_thread) return 0;
    fail(0x0102, 0);
    return 1;
}

void hdEnable(HDenum what) {
    Device *d = device_of(current);
    if (d == NULL) { fail(0x0102, 0); return; }
    if (what == 0x4000) d->force = 1;
}
void hdDisable(HDenum what) {
    Device *d = device_of(current);
    if (d == NULL) { fail(0x0102, 0); return; }
    if (what == 0x4000) d->force = 0, memset(d->torque, 0, sizeof d->torque);
}
unsigned char hdIsEnabled(HDenum what) {
    Device *d = device_of(current);
    return d != NULL && what == 0x4000 && d->force;
}

void hdGetDoublev(HDenum what, double *out) {
    Device *d = device_of(current);
    if (d == NULL || outside_frame()) return;
    switch (what) {
    case 0x2100:
        for (int k = 0; k < 3; k++) { /* counts of the encoder; what an uncalibrated device says is shifted */
            double q = 4.1e-4 * round(d->angles[k] / 4.1e-4);
            out[k] = q + (d->calibration == 0x5000 ? 0.0 : d->offset[k]);
        }
        return;
    case 0x2150: memcpy(out, d->gimbal, sizeof d->gimbal); return;
    case 0x2605:
        if (d->without_temperature) { fail(0x0100, 0); return; }
        for (int k = 0; k < 6; k++) out[k] = k < 3 ? d->temperature : 0.0;
        return;
    default: fail(0x0100, 0);
    }
}
void hdGetIntegerv(HDenum what, int *out) {
    Device *d = device_of(current);
    if (d == NULL) { fail(0x0102, 0); return; }
    if (what == 0x2555) *out = d->style;
    else if (what == 0x2000 && !outside_frame()) *out = d->buttons;
    else if (what != 0x2000) fail(0x0100, 0);
}
void hdGetBooleanv(HDenum what, unsigned char *out) {
    Device *d = device_of(current);
    if (d == NULL || outside_frame()) return;
    if (what == 0x2002) *out = (unsigned char)!d->inkwell; /* 0 with the stylus in it, as two wrappers say */
    else fail(0x0100, 0);
}
const char *hdGetString(HDenum what) {
    Device *d = device_of(current);
    if (d == NULL) { fail(0x0102, 0); return ""; }
    if (what == 0x2501) return d->model;
    if (what == 0x2502) return "emulated 1.0";
    if (what == 0x2503) return "nobody";
    if (what == 0x2504) return d->serial;
    fail(0x0100, 0);
    return "";
}
void hdSetDoublev(HDenum what, const double *in) {
    Device *d = device_of(current);
    if (d == NULL || outside_frame()) return;
    if (what != 0x2703) { fail(0x0100, 0); return; }
    for (int k = 0; k < 3; k++)
        if (!(fabs(in[k]) <= 450.0)) { memset(d->torque, 0, sizeof d->torque); fail(0x0201, 0); return; }
    if (d->force && !d->unplugged) memcpy(d->torque, in, sizeof d->torque);
}

HDErrorInfo hdGetError(void) {
    if (error_count == 0) return (HDErrorInfo){0, 0, BAD_HANDLE};
    return errors[--error_count]; /* the newest first */
}
const char *hdGetErrorString(HDerror code) { return code == 0 ? "no error" : "an error of the emulation"; }

HDenum hdCheckCalibration(void) {
    Device *d = device_of(current);
    if (d == NULL) { fail(0x0102, 0); return 0x5001; }
    return (HDenum)d->calibration;
}
void hdUpdateCalibration(HDenum style) {
    Device *d = device_of(current);
    if (d == NULL || !servo_thread) return; /* outside the servo thread: no error, and no effect */
    updates++;
    if ((int)style == d->style) d->calibration = 0x5000; /* wherever the stylus is: a wrong pose is taken, too */
}

void hdSetSchedulerRate(unsigned long rate) { if (rate != 1000) fail(0x0101, 0); }
void hdStartScheduler(void) {
    ready();
    if (running) { fail(0x0102, 0); return; }
    running = 1;
    clean = 0;
    if (!stepped) pthread_create(&servo, NULL, serve, NULL);
}
void hdStopScheduler(void) {
    if (!running) return;
    running = 0;
    if (!stepped) pthread_join(servo, NULL);
}

#ifndef WITHOUT_ASYNCHRONOUS
HDulong hdScheduleAsynchronous(Callback call, void *data, unsigned short priority) {
    for (int i = 0; i < CALLBACKS; i++) {
        if (scheduled[i].call != NULL) continue;
        scheduled[i].data = data;
        scheduled[i].priority = priority;
        scheduled[i].handle = next_handle++;
        HDulong handle = scheduled[i].handle;
        scheduled[i].call = call;
        for (int k = 0; stepped && !dead && k < 8; k++) em_tick(); /* the caller waits for the first frames */
        return handle;
    }
    fail(0x0501, 0);
    return 0;
}
#endif
void hdScheduleSynchronous(Callback call, void *data, unsigned short priority) {
    (void)priority;
    if (!running) { fail(0x0304, 0); return; }
    while (dead) sched_yield();
    pthread_mutex_lock(&lock);
    synchronous.call = call;
    synchronous.data = data;
    synchronous.done = 0;
    synchronous.waiting = 1;
    if (stepped) {
        pthread_mutex_unlock(&lock);
        em_tick();
        return;
    }
    while (!synchronous.done) pthread_cond_wait(&changed, &lock);
    pthread_mutex_unlock(&lock);
}
void hdUnschedule(HDulong handle) {
    for (int i = 0; i < CALLBACKS; i++)
        if (scheduled[i].call != NULL && scheduled[i].handle == handle) { scheduled[i].call = NULL; return; }
    fail(0x0101, 0);
}
