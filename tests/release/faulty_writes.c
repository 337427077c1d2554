/* Makes a write to a folder fail: a library that tests.release.writes preloads.

   Every call that changes what lies below the folder is counted, over all processes that share the
   control file; the one with the stated number fails, and those after it where that is asked for.
   So do those of libraries that Python knows nothing of. What stdio writes within the C library
   itself is not seen: nothing here uses that. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#define LONGEST 1024 /* letters of a path; longer ones are not of the folder */
#define KINDS 65536

enum kind { OPEN = 1, WRITE, CLOSE, RENAME, MKDIR, CHMOD, TRUNCATE, SYNC, LINK, TIMES };

/* As in tests/release/writes.py. */
struct control {
    int64_t count;   /* of calls so far */
    int64_t at;      /* the one that fails; 0: none */
    int64_t error;   /* errno */
    int64_t lasting; /* those after it fail, too */
    int64_t struck;  /* how many have */
    char folder[LONGEST];
    uint8_t kinds[KINDS]; /* of the first calls */
};

static struct control *control;

__attribute__((constructor)) static void begin(void) {
    const char *path = getenv("FAULTY_WRITES");
    int (*really)(const char *, int, ...) = dlsym(RTLD_NEXT, "open64");
    int file = path ? really(path, O_RDWR | O_CLOEXEC) : -1;
    if (file < 0)
        return;
    void *shared = mmap(NULL, sizeof *control, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    ((int (*)(int))dlsym(RTLD_NEXT, "close"))(file);
    if (shared != MAP_FAILED)
        control = shared;
}

static int below(const char *path) {
    size_t length = strlen(control->folder);
    return length && !strncmp(path, control->folder, length) && (path[length] == '/' || !path[length]);
}

static int of_link(const char *link) {
    char path[LONGEST + 1];
    ssize_t length = readlink(link, path, LONGEST);
    if (length < 0)
        return 0;
    path[length] = 0;
    return below(path);
}

static int of_file(int file) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    return of_link(link);
}

static int of_path(int folder, const char *path) {
    if (!path)
        return 0;
    if (*path == '/')
        return below(path);
    return folder == AT_FDCWD ? of_link("/proc/self/cwd") : of_file(folder);
}

/* Count a call, and tell whether it is to fail; errno is set then. */
static int struck(enum kind kind) {
    int64_t number = __atomic_add_fetch(&control->count, 1, __ATOMIC_SEQ_CST);
    if (number < KINDS)
        control->kinds[number] = kind;
    if (!control->at || number < control->at || (number > control->at && !control->lasting))
        return 0;
    if (control->lasting && (kind == CHMOD || kind == CLOSE || kind == TIMES))
        return 0; /* a full disk takes these */
    __atomic_add_fetch(&control->struck, 1, __ATOMIC_SEQ_CST);
    errno = (int)control->error;
    return 1;
}

static int fails_at(int folder, const char *path, enum kind kind) {
    int before = errno;
    int fails = control && of_path(folder, path) && struck(kind);
    if (!fails)
        errno = before;
    return fails;
}

static int fails(int file, enum kind kind) {
    int before = errno;
    int fails = control && of_file(file) && struck(kind);
    if (!fails)
        errno = before;
    return fails;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
#define MODE(flags)                                                                                \
    mode_t mode = 0;                                                                               \
    if ((flags) & (O_CREAT | O_TMPFILE)) {                                                         \
        va_list rest;                                                                              \
        va_start(rest, flags);                                                                     \
        mode = va_arg(rest, mode_t);                                                               \
        va_end(rest);                                                                              \
    }

static int changes(int flags) { return (flags & O_ACCMODE) != O_RDONLY || flags & (O_CREAT | O_TRUNC); }

int open(const char *path, int flags, ...) {
    MODE(flags)
    return changes(flags) && fails_at(AT_FDCWD, path, OPEN) ? -1 : REAL(open)(path, flags, mode);
}
int open64(const char *path, int flags, ...) {
    MODE(flags)
    return changes(flags) && fails_at(AT_FDCWD, path, OPEN) ? -1 : REAL(open64)(path, flags, mode);
}
int openat(int folder, const char *path, int flags, ...) {
    MODE(flags)
    return changes(flags) && fails_at(folder, path, OPEN) ? -1 : REAL(openat)(folder, path, flags, mode);
}
int openat64(int folder, const char *path, int flags, ...) {
    MODE(flags)
    return changes(flags) && fails_at(folder, path, OPEN) ? -1 : REAL(openat64)(folder, path, flags, mode);
}
FILE *fopen(const char *path, const char *mode) {
    return *mode != 'r' && fails_at(AT_FDCWD, path, OPEN) ? NULL : REAL(fopen)(path, mode);
}
FILE *fopen64(const char *path, const char *mode) {
    return *mode != 'r' && fails_at(AT_FDCWD, path, OPEN) ? NULL : REAL(fopen64)(path, mode);
}

/* A disk that is full has taken a part of what was written. */
ssize_t write(int file, const void *data, size_t size) {
    if (!fails(file, WRITE))
        return REAL(write)(file, data, size);
    int error = errno;
    if (control->lasting && control->struck == 1 && size > 1)
        return REAL(write)(file, data, size / 2);
    errno = error;
    return -1;
}
ssize_t pwrite(int file, const void *data, size_t size, off_t at) {
    return fails(file, WRITE) ? -1 : REAL(pwrite)(file, data, size, at);
}
ssize_t pwrite64(int file, const void *data, size_t size, off64_t at) {
    return fails(file, WRITE) ? -1 : REAL(pwrite64)(file, data, size, at);
}
ssize_t writev(int file, const struct iovec *parts, int number) {
    return fails(file, WRITE) ? -1 : REAL(writev)(file, parts, number);
}
size_t fwrite(const void *data, size_t size, size_t number, FILE *file) {
    return fails(fileno(file), WRITE) ? 0 : REAL(fwrite)(data, size, number, file);
}
int close(int file) {
    int flags = control ? fcntl(file, F_GETFL) : -1;
    int failed = flags >= 0 && (flags & O_ACCMODE) != O_RDONLY && fails(file, CLOSE);
    int error = errno, done = REAL(close)(file);
    if (failed)
        errno = error;
    return failed ? -1 : done;
}
int rename(const char *from, const char *to) {
    return fails_at(AT_FDCWD, to, RENAME) ? -1 : REAL(rename)(from, to);
}
int renameat(int from, const char *old, int to, const char *new) {
    return fails_at(to, new, RENAME) ? -1 : REAL(renameat)(from, old, to, new);
}
int mkdir(const char *path, mode_t mode) {
    struct stat known;
    return stat(path, &known) && fails_at(AT_FDCWD, path, MKDIR) ? -1 : REAL(mkdir)(path, mode);
}
int mkdirat(int folder, const char *path, mode_t mode) {
    return fails_at(folder, path, MKDIR) ? -1 : REAL(mkdirat)(folder, path, mode);
}
int chmod(const char *path, mode_t mode) {
    return fails_at(AT_FDCWD, path, CHMOD) ? -1 : REAL(chmod)(path, mode);
}
int fchmod(int file, mode_t mode) { return fails(file, CHMOD) ? -1 : REAL(fchmod)(file, mode); }
int fchmodat(int folder, const char *path, mode_t mode, int flags) {
    return fails_at(folder, path, CHMOD) ? -1 : REAL(fchmodat)(folder, path, mode, flags);
}
int ftruncate(int file, off_t size) { return fails(file, TRUNCATE) ? -1 : REAL(ftruncate)(file, size); }
int ftruncate64(int file, off64_t size) {
    return fails(file, TRUNCATE) ? -1 : REAL(ftruncate64)(file, size);
}
int fsync(int file) { return fails(file, SYNC) ? -1 : REAL(fsync)(file); }
int fdatasync(int file) { return fails(file, SYNC) ? -1 : REAL(fdatasync)(file); }
int symlink(const char *from, const char *to) {
    return fails_at(AT_FDCWD, to, LINK) ? -1 : REAL(symlink)(from, to);
}
int link(const char *from, const char *to) {
    return fails_at(AT_FDCWD, to, LINK) ? -1 : REAL(link)(from, to);
}
int utimensat(int folder, const char *path, const struct timespec times[2], int flags) {
    return fails_at(folder, path, TIMES) ? -1 : REAL(utimensat)(folder, path, times, flags);
}
