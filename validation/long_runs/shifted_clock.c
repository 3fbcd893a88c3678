/* Shows a process the wall clock of another day, for LD_PRELOAD.

   The file that SHIFTED_CLOCK names holds the shift as a 64-bit number of seconds. It is mapped:
   whoever changes it moves the clock of all processes at once. Steady clocks, timers and the
   times of files stay as they are. Waits until a moment of the wall clock are moved back: they
   last as long as they were meant to. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

/* No machine has been up for so long [s]: what is later is a moment of the wall clock. */
#define LONGEST_UPTIME 1000000000

static int64_t shift(void) {
    static const volatile int64_t *mapped;
    static int looked;
    if (!looked) {
        const char *path = getenv("SHIFTED_CLOCK");
        int file = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
        if (file >= 0) {
            void *place = mmap(NULL, sizeof *mapped, PROT_READ, MAP_SHARED, file, 0);
            mapped = place == MAP_FAILED ? NULL : place;
            close(file);
        }
        looked = 1;
    }
    return mapped ? *mapped : 0;
}

static void *real(const char *name) {
    /* Functions of conditions have two versions; without a name dlsym may give the old one. */
    void *found = dlvsym(RTLD_NEXT, name, "GLIBC_2.3.2");
    return found ? found : dlsym(RTLD_NEXT, name);
}

#define REAL(name) \
    static __typeof__(&name) original; \
    if (!original) original = (__typeof__(&name))real(#name)

int clock_gettime(clockid_t clock, struct timespec *now) {
    REAL(clock_gettime);
    int failed = original(clock, now);
    if (!failed && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE))
        now->tv_sec += shift();
    return failed;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone) {
    REAL(gettimeofday);
    int failed = original(now, zone);
    if (!failed)
        now->tv_sec += shift();
    return failed;
}

time_t time(time_t *now) {
    struct timespec found;
    clock_gettime(CLOCK_REALTIME, &found);
    if (now)
        *now = found.tv_sec;
    return found.tv_sec;
}

static struct timespec unshifted(const struct timespec *end) {
    struct timespec moved = *end;
    if (moved.tv_sec > LONGEST_UPTIME)
        moved.tv_sec -= shift();
    return moved;
}

int pthread_cond_timedwait(pthread_cond_t *restrict condition, pthread_mutex_t *restrict mutex,
                           const struct timespec *restrict end) {
    REAL(pthread_cond_timedwait);
    struct timespec moved = unshifted(end);
    return original(condition, mutex, &moved);
}

int pthread_cond_clockwait(pthread_cond_t *restrict condition, pthread_mutex_t *restrict mutex,
                           clockid_t clock, const struct timespec *restrict end) {
    REAL(pthread_cond_clockwait);
    struct timespec moved = unshifted(end);
    return original(condition, mutex, clock, &moved);
}

int pthread_mutex_timedlock(pthread_mutex_t *restrict mutex, const struct timespec *restrict end) {
    REAL(pthread_mutex_timedlock);
    struct timespec moved = unshifted(end);
    return original(mutex, &moved);
}

int pthread_mutex_clocklock(pthread_mutex_t *restrict mutex, clockid_t clock,
                            const struct timespec *restrict end) {
    REAL(pthread_mutex_clocklock);
    struct timespec moved = unshifted(end);
    return original(mutex, clock, &moved);
}

int sem_timedwait(sem_t *restrict semaphore, const struct timespec *restrict end) {
    REAL(sem_timedwait);
    struct timespec moved = unshifted(end);
    return original(semaphore, &moved);
}

int sem_clockwait(sem_t *restrict semaphore, clockid_t clock,
                  const struct timespec *restrict end) {
    REAL(sem_clockwait);
    struct timespec moved = unshifted(end);
    return original(semaphore, clock, &moved);
}
