/* Let user-mode-linux run on processors whose floating-point state has outgrown it (those with AMX).

   It writes back as many bytes of that state as it has room for, and the host takes all of them or none
   (EFAULT): the rest is left here as the process holds it. To be preloaded. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/uio.h>

#define NT_X86_XSTATE 0x202

static long (*host_ptrace)(int, ...);

long ptrace(enum __ptrace_request request, ...)
{
    static char state[1 << 16] __attribute__((aligned(64)));
    struct iovec whole = {state, sizeof state};
    va_list arguments;
    va_start(arguments, request);
    long process = va_arg(arguments, long);
    void *address = va_arg(arguments, void *);
    struct iovec *part = va_arg(arguments, void *);
    va_end(arguments);
    if (!host_ptrace)
        host_ptrace = (long (*)(int, ...))dlsym(RTLD_NEXT, "ptrace");
    if (request == PTRACE_SETREGSET && (long)address == NT_X86_XSTATE &&
        host_ptrace(PTRACE_GETREGSET, process, address, &whole) == 0 && part->iov_len < whole.iov_len) {
        memcpy(state, part->iov_base, part->iov_len);
        return host_ptrace(request, process, address, &whole);
    }
    return host_ptrace(request, process, address, part);
}
