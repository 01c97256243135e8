// A disk that fails: lets one call that changes a file below a folder fail, or all from one on.
//
//   cc -shared -fPIC -O1 -o failing_writes.so failing_writes.c -ldl
//   LD_PRELOAD=./failing_writes.so FAULT_FOLDER="$PWD/map" FAULT_AT=7 FAULT_ERRNO=28 gslts ...
//
// FAULT_FOLDER  Absolute, without links; what lies elsewhere is left alone, as is all without it.
// FAULT_AT      Which call fails, from 1 on; none if it is not set.
// FAULT_ERRNO   Of the call that fails, as a number.
// FAULT_LASTS   If it is set, all calls after that one fail as well.
// FAULT_LOG     A file that gets one line for each call: its number, name, file, and if it failed.
//
// The environment is read at each call, so that a process may set it for a child that it forks. A
// write that fails has written half of what it should, as a real disk may. What is not seen: mmap,
// and calls that glibc makes itself, such as those of fopen.

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int count;

static void path_of(int folder, const char* path, char* absolute) {
  char link[64];
  *absolute = 0;
  ssize_t size = 0;
  if (!path || path[0] != '/') {
    if (folder == AT_FDCWD) {
      strcpy(link, "/proc/self/cwd");
    } else {
      snprintf(link, sizeof link, "/proc/self/fd/%d", folder);
    }
    size = readlink(link, absolute, PATH_MAX - 1);
    if (size < 0) return;
    absolute[size] = 0;
  }
  if (path) snprintf(absolute + size, PATH_MAX - size, "%s%s", size ? "/" : "", path);
}

static void note(int number, const char* call, const char* file, int fails) {
  const char* path = getenv("FAULT_LOG");
  if (!path) return;
  char line[PATH_MAX + 64];
  int size = snprintf(line, sizeof line, "%d %s %s%s\n", number, call, file, fails ? " FAILS" : "");
  int log = syscall(SYS_openat, AT_FDCWD, path, O_WRONLY | O_CREAT | O_APPEND, 0644);
  syscall(SYS_write, log, line, (size_t)size);
  syscall(SYS_close, log);
}

// Whether a call fails; then errno is set. The file is that of a path, or of a descriptor.
static int fails(const char* call, int folder, const char* path) {
  const char* watched = getenv("FAULT_FOLDER");
  if (!watched) return 0;
  int before = errno;
  char absolute[PATH_MAX];
  path_of(folder, path, absolute);
  size_t length = strlen(watched);
  errno = before;
  if (strncmp(absolute, watched, length) != 0 || (absolute[length] && absolute[length] != '/')) {
    return 0;
  }
  const char* at = getenv("FAULT_AT");
  int number = __atomic_add_fetch(&count, 1, __ATOMIC_SEQ_CST);
  int wanted = at ? atoi(at) : INT_MAX;
  int failing = number == wanted || (number > wanted && getenv("FAULT_LASTS"));
  note(number, call, absolute, failing);
  errno = failing ? atoi(getenv("FAULT_ERRNO")) : before;
  return failing;
}

static int changes(int flags) { return (flags & O_ACCMODE) != O_RDONLY || (flags & O_CREAT); }

#define OPEN(name, before_arguments, arguments, folder)                              \
  int name before_arguments {                                                        \
    va_list list;                                                                    \
    va_start(list, flags);                                                           \
    int mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(list, int) : 0;                \
    va_end(list);                                                                    \
    return changes(flags) && fails(#name, folder, path) ? -1 : REAL(name) arguments; \
  }
OPEN(open, (const char* path, int flags, ...), (path, flags, mode), AT_FDCWD)
OPEN(open64, (const char* path, int flags, ...), (path, flags, mode), AT_FDCWD)
OPEN(openat, (int folder, const char* path, int flags, ...), (folder, path, flags, mode), folder)
OPEN(openat64, (int folder, const char* path, int flags, ...), (folder, path, flags, mode), folder)

ssize_t write(int file, const void* data, size_t size) {
  if (!fails("write", file, NULL)) return REAL(write)(file, data, size);
  int error = errno;
  REAL(write)(file, data, size / 2);
  errno = error;
  return -1;
}

ssize_t writev(int file, const struct iovec* parts, int count_of) {
  return fails("writev", file, NULL) ? -1 : REAL(writev)(file, parts, count_of);
}

#define PWRITE(name, type)                                                      \
  ssize_t name(int file, const void* data, size_t size, type offset) {          \
    if (!fails(#name, file, NULL)) return REAL(name)(file, data, size, offset); \
    int error = errno;                                                          \
    REAL(name)(file, data, size / 2, offset);                                   \
    errno = error;                                                              \
    return -1;                                                                  \
  }
PWRITE(pwrite, off_t)
PWRITE(pwrite64, off64_t)

#define CALL(name, parameters, arguments, folder, path) \
  int name parameters { return fails(#name, folder, path) ? -1 : REAL(name) arguments; }
CALL(fsync, (int file), (file), file, NULL)
CALL(fdatasync, (int file), (file), file, NULL)
CALL(ftruncate, (int file, off_t size), (file, size), file, NULL)
CALL(ftruncate64, (int file, off64_t size), (file, size), file, NULL)
CALL(mkdir, (const char* path, mode_t mode), (path, mode), AT_FDCWD, path)
CALL(mkdirat, (int folder, const char* path, mode_t mode), (folder, path, mode), folder, path)
CALL(rmdir, (const char* path), (path), AT_FDCWD, path)
CALL(unlink, (const char* path), (path), AT_FDCWD, path)
CALL(unlinkat, (int folder, const char* path, int flags), (folder, path, flags), folder, path)
CALL(rename, (const char* path, const char* to), (path, to), AT_FDCWD, path)
CALL(renameat, (int folder, const char* path, int other, const char* to), (folder, path, other, to),
     folder, path)
