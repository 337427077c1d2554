/* Another clock of the system: a library that tests.release.surroundings preloads.

   OTHER_CLOCK has offsets in s, such as "0 -3600 86400": the clock is ahead by one of them after the
   other, and jumps to the next every two seconds. A file that is closed after it was written has
   the stamp of this clock, as on a machine whose clock is such. What counts time from the start of
   the machine goes on as it does. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define MOST 16
#define SECONDS 2

static long offsets[MOST];
static int count;
static int (*really_get)(clockid_t, struct timespec *);
static int (*really_close)(int);

__attribute__((constructor)) static void begin(void) {
    const char *text = getenv("OTHER_CLOCK");
    char *end;
    really_get = dlsym(RTLD_NEXT, "clock_gettime");
    really_close = dlsym(RTLD_NEXT, "close");
    while (text && *text && count < MOST) {
        offsets[count++] = strtol(text, &end, 10);
        text = end == text ? NULL : end;
    }
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    struct timespec running;
    if (!really_get)
        begin();
    int failed = really_get(clock, now);
    if (failed || !count || (clock != CLOCK_REALTIME && clock != CLOCK_REALTIME_COARSE))
        return failed;
    really_get(CLOCK_MONOTONIC, &running);
    now->tv_sec += offsets[running.tv_sec / SECONDS % count];
    return 0;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone) {
    struct timespec exact;
    (void)zone;
    int failed = clock_gettime(CLOCK_REALTIME, &exact);
    now->tv_sec = exact.tv_sec;
    now->tv_usec = exact.tv_nsec / 1000;
    return failed;
}

time_t time(time_t *stored) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (stored)
        *stored = now.tv_sec;
    return now.tv_sec;
}

int close(int file) {
    struct stat about;
    struct timespec stamps[2] = {{0, UTIME_OMIT}, {0, 0}};
    int flags = fcntl(file, F_GETFL);
    if (count && flags >= 0 && (flags & O_ACCMODE) != O_RDONLY && !fstat(file, &about) &&
        S_ISREG(about.st_mode) && !clock_gettime(CLOCK_REALTIME, &stamps[1]))
        futimens(file, stamps);
    return really_close(file);
}
