/* Preloaded into the processes under test: a wall clock that jumps, and a journal of what a power cut would lose.

   CHAOS_CLOCK    a file of 8 bytes, the offset of the wall clock in seconds (double), read at every question
   CHAOS_JOURNAL  where writes, syncs and renames below CHAOS_DISK are noted, in the order in which they happened:
                  W path, S path size, D folder, R old new, U path (fields between tabs) */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static volatile double *offset_s;
static const char *disk;
static int journal = -1;
static int (*real_clock_gettime)(clockid_t, struct timespec *);

__attribute__((constructor)) static void start(void) {
    const char *clock_file = getenv("CHAOS_CLOCK"), *journal_file = getenv("CHAOS_JOURNAL");
    real_clock_gettime = dlsym(RTLD_NEXT, "clock_gettime");
    if (clock_file) {
        int fd = open(clock_file, O_RDONLY | O_CLOEXEC);
        void *at = fd < 0 ? MAP_FAILED : mmap(NULL, sizeof(double), PROT_READ, MAP_SHARED, fd, 0);
        if (at != MAP_FAILED) offset_s = at;
        if (fd >= 0) close(fd);
    }
    disk = getenv("CHAOS_DISK");
    if (journal_file && disk) journal = open(journal_file, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
}

static void shift(struct timespec *t) {
    if (!offset_s) return;
    double whole = floor(*offset_s);
    t->tv_sec += (time_t)whole;
}

int clock_gettime(clockid_t which, struct timespec *t) {
    int done = real_clock_gettime ? real_clock_gettime(which, t) : (int)syscall(SYS_clock_gettime, which, t);
    if (done == 0 && (which == CLOCK_REALTIME || which == CLOCK_REALTIME_COARSE)) shift(t);
    return done;
}

int gettimeofday(struct timeval *restrict t, void *restrict zone) {
    struct timespec now;
    (void)zone;
    clock_gettime(CLOCK_REALTIME, &now);
    t->tv_sec = now.tv_sec;
    t->tv_usec = now.tv_nsec / 1000;
    return 0;
}

time_t time(time_t *t) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (t) *t = now.tv_sec;
    return now.tv_sec;
}

static void note(const char *form, ...) {
    char line[3 * PATH_MAX];
    va_list values;
    va_start(values, form);
    int length = vsnprintf(line, sizeof line, form, values);
    va_end(values);
    if (length > 0 && length < (int)sizeof line) syscall(SYS_write, journal, line, (size_t)length);
}

static int below(const char *path) { return journal >= 0 && strncmp(path, disk, strlen(disk)) == 0; }

static int path_of(int fd, char *path) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, PATH_MAX - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return below(path);
}

ssize_t write(int fd, const void *data, size_t size) {
    char path[PATH_MAX];
    if (journal >= 0 && path_of(fd, path)) note("W\t%s\n", path);
    return syscall(SYS_write, fd, data, size);
}

static void synced(int fd) {
    char path[PATH_MAX];
    struct stat about;
    if (journal < 0 || !path_of(fd, path) || fstat(fd, &about)) return;
    if (S_ISDIR(about.st_mode)) note("D\t%s\n", path);
    else note("S\t%s\t%lld\n", path, (long long)about.st_size);
}

int fsync(int fd) {
    int done = (int)syscall(SYS_fsync, fd);
    if (done == 0) synced(fd);
    return done;
}

int fdatasync(int fd) {
    int done = (int)syscall(SYS_fdatasync, fd);
    if (done == 0) synced(fd);
    return done;
}

int rename(const char *old, const char *new) {
    int there = access(new, F_OK) == 0;
    int done = (int)syscall(SYS_rename, old, new);
    if (done == 0 && below(new)) note("R\t%s\t%s\t%d\n", old, new, there);
    return done;
}

int unlink(const char *path) {
    int done = (int)syscall(SYS_unlink, path);
    if (done == 0 && below(path)) note("U\t%s\n", path);
    return done;
}
