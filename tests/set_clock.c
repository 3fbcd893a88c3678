/* The system's clock, set for the processes that this library is loaded into (LD_PRELOAD).
 *
 * The nanoseconds by which it is set stand in the file SET_CLOCK_FILE, eight bytes, mapped: whoever
 * writes there sets it at once. A steady clock is not touched. Waits until a moment of the
 * system's clock follow it while they wait, as the kernel's do. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define SECOND 1000000000LL
#define SLICE 20000000LL  /* ns; so often a wait looks at the clock */
#define STEADY 1000000000 /* s; a moment below is one of a steady clock */

typedef int (*clock_f)(clockid_t, struct timespec *);
typedef int (*wait_f)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
typedef int (*lock_f)(pthread_mutex_t *, const struct timespec *);

static const volatile int64_t nothing = 0;
static const volatile int64_t *set_by = &nothing;
static clock_f next_clock;
static wait_f next_wait;
static lock_f next_lock;
static int (*next_semaphore)(sem_t *, const struct timespec *);

__attribute__((constructor)) static void begin(void) {
  const char *path = getenv("SET_CLOCK_FILE");
  next_clock = (clock_f)dlsym(RTLD_NEXT, "clock_gettime");
  next_wait = (wait_f)dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
  if (!next_wait) next_wait = (wait_f)dlsym(RTLD_NEXT, "pthread_cond_timedwait");
  next_lock = (lock_f)dlsym(RTLD_NEXT, "pthread_mutex_timedlock");
  next_semaphore =
      (int (*)(sem_t *, const struct timespec *))dlsym(RTLD_NEXT, "sem_timedwait");
  int file = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
  if (file < 0) return;
  void *place = mmap(NULL, sizeof(int64_t), PROT_READ, MAP_SHARED, file, 0);
  if (place != MAP_FAILED) set_by = place;
  close(file);
}

static int64_t true_time(void) {
  struct timespec now;
  if (!next_clock) begin();
  next_clock(CLOCK_REALTIME, &now);
  return now.tv_sec * SECOND + now.tv_nsec;
}

static struct timespec moment(int64_t time) {
  return (struct timespec){time / SECOND, time % SECOND};
}

int clock_gettime(clockid_t clock, struct timespec *now) {
  if (!next_clock) begin();
  int failed = next_clock(clock, now);
  if (failed || (clock != CLOCK_REALTIME && clock != CLOCK_REALTIME_COARSE)) return failed;
  *now = moment(now->tv_sec * SECOND + now->tv_nsec + *set_by);
  return 0;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone) {
  (void)zone;
  int64_t time = true_time() + *set_by;
  *now = (struct timeval){time / SECOND, time % SECOND / 1000};
  return 0;
}

time_t time(time_t *place) {
  time_t now = (true_time() + *set_by) / SECOND;
  if (place) *place = now;
  return now;
}

/* When to look again, of the true clock; 0: the moment has come. */
static int64_t next_look(const struct timespec *until) {
  int64_t now = true_time();
  int64_t left = until->tv_sec * SECOND + until->tv_nsec - now - *set_by;
  return left <= 0 ? 0 : now + (left < SLICE ? left : SLICE);
}

int pthread_cond_timedwait(pthread_cond_t *restrict condition, pthread_mutex_t *restrict mutex,
                           const struct timespec *restrict until) {
  if (until->tv_sec < STEADY) return next_wait(condition, mutex, until);
  for (int64_t look; (look = next_look(until));) {
    struct timespec then = moment(look);
    int result = next_wait(condition, mutex, &then);
    if (result != ETIMEDOUT) return result;
  }
  return ETIMEDOUT;
}

int pthread_mutex_timedlock(pthread_mutex_t *restrict mutex, const struct timespec *restrict until) {
  for (int64_t look; (look = next_look(until));) {
    struct timespec then = moment(look);
    int result = next_lock(mutex, &then);
    if (result != ETIMEDOUT) return result;
  }
  return pthread_mutex_trylock(mutex) ? ETIMEDOUT : 0;
}

int sem_timedwait(sem_t *restrict semaphore, const struct timespec *restrict until) {
  for (int64_t look; (look = next_look(until));) {
    struct timespec then = moment(look);
    if (next_semaphore(semaphore, &then) == 0) return 0;
    if (errno != ETIMEDOUT) return -1;
  }
  return sem_trywait(semaphore) ? (errno = ETIMEDOUT, -1) : 0;
}
