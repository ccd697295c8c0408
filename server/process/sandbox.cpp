#include "server/process/sandbox.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <sstream>
#include <string>

#include <fcntl.h>
#include <linux/capability.h>
#include <linux/landlock.h>
#include <linux/sched.h>
#include <seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "base/error.h"
#include "proto/error.h"

namespace isomesh::process {
namespace {

// A sanitizer reserves terabytes of addresses, so memory cannot be limited.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define ISOMESH_IS_SANITIZED
constexpr bool kLimitMemory = false;
#else
constexpr bool kLimitMemory = true;
#endif

void require(bool done, std::string_view call) {
  if (!done) throw_system_error(call, errno);
}

// --- Limits --------------------------------------------------------------------------------------

std::uint64_t sum(std::initializer_list<std::uint64_t> numbers) {
  std::uint64_t total = 0;
  for (const std::uint64_t number : numbers) {
    if (number > std::numeric_limits<std::uint64_t>::max() - total) return RLIM_INFINITY;
    total += number;
  }
  return total;
}

// With `grace`, a process that reaches `most` is first told by a signal.
void limit(__rlimit_resource resource, std::uint64_t most, std::uint64_t grace = 0) {
  rlimit bounds = {};
  require(::getrlimit(resource, &bounds) == 0, "getrlimit");
  bounds.rlim_max = std::min<rlim_t>(bounds.rlim_max, sum({most, grace}));
  bounds.rlim_cur = std::min<rlim_t>(std::max<rlim_t>(bounds.rlim_max, grace) - grace, most);
  require(::setrlimit(resource, &bounds) == 0, "setrlimit");
}

void limit_resources(const Confinement& confinement) {
  constexpr std::uint64_t kPrograms = std::uint64_t{512} << 20;  // code, libraries, the stack
  limit(RLIMIT_FSIZE, confinement.file_bytes);
  // SIGXCPU ends the process, and says why: at the limit itself it would be killed like any other.
  constexpr std::uint64_t kGraceSeconds = 1;
  limit(RLIMIT_CPU, static_cast<std::uint64_t>(confinement.time.count()), kGraceSeconds);
  // With the signal ignored, a write beyond the limit fails with EFBIG, which can be reported.
  std::signal(SIGXFSZ, SIG_IGN);
  if constexpr (kLimitMemory) {
    limit(RLIMIT_DATA, confinement.memory_bytes);
    limit(RLIMIT_AS, sum({confinement.memory_bytes, confinement.file_bytes, kPrograms}));
  }
}

// --- Files (Landlock) ----------------------------------------------------------------------------

// The right to truncate files is missing in Debian 12's headers.
constexpr std::uint64_t kTruncate = std::uint64_t{1} << 14;

// The rights that a version of Landlock can restrict.
std::uint64_t rights_of_version(long version) {
  std::uint64_t rights = (std::uint64_t{1} << 13) - 1;
  if (version >= 2) rights |= LANDLOCK_ACCESS_FS_REFER;
  if (version >= 3) rights |= kTruncate;
  return rights;
}

long landlock_version() {
  return ::syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
}

void allow(const Descriptor& ruleset, const std::filesystem::path& path, std::uint64_t rights) {
  const Descriptor place(::open(path.c_str(), O_PATH | O_CLOEXEC));
  require(place.number() >= 0, "open");
  landlock_path_beneath_attr rule = {};
  rule.allowed_access = rights;
  rule.parent_fd = place.number();
  require(
      ::syscall(SYS_landlock_add_rule, ruleset.number(), LANDLOCK_RULE_PATH_BENEATH, &rule, 0) == 0,
      "landlock_add_rule");
}

// Leaves access to the file `readable` and to the folder `writable`, if given.
void restrict_files(const std::filesystem::path& readable, const std::filesystem::path& writable) {
  const long version = landlock_version();
  if (version < 1) return;
  landlock_ruleset_attr attributes = {};
  attributes.handled_access_fs = rights_of_version(version);
  const Descriptor ruleset(
      static_cast<int>(::syscall(SYS_landlock_create_ruleset, &attributes, sizeof(attributes), 0)));
  require(ruleset.number() >= 0, "landlock_create_ruleset");
  constexpr std::uint64_t kRead = LANDLOCK_ACCESS_FS_READ_FILE;
  constexpr std::uint64_t kWork = kRead | LANDLOCK_ACCESS_FS_READ_DIR |
                                  LANDLOCK_ACCESS_FS_WRITE_FILE | LANDLOCK_ACCESS_FS_MAKE_REG |
                                  LANDLOCK_ACCESS_FS_MAKE_DIR | LANDLOCK_ACCESS_FS_REMOVE_FILE |
                                  LANDLOCK_ACCESS_FS_REMOVE_DIR | kTruncate;
  if (!readable.empty()) allow(ruleset, readable, kRead);
  if (!writable.empty()) allow(ruleset, writable, kWork & attributes.handled_access_fs);
  require(::syscall(SYS_landlock_restrict_self, ruleset.number(), 0) == 0,
          "landlock_restrict_self");
}

// --- System calls (seccomp) ----------------------------------------------------------------------

// All other calls fail with EPERM, which libraries can handle, instead of ending the process.
constexpr std::array kAllowedCalls = {
#ifdef ISOMESH_IS_SANITIZED
    SCMP_SYS(pipe), SCMP_SYS(pipe2),  // sanitizers test with them whether memory is readable
#endif
    // files
    SCMP_SYS(read), SCMP_SYS(readv), SCMP_SYS(pread64), SCMP_SYS(write), SCMP_SYS(writev),
    SCMP_SYS(pwrite64), SCMP_SYS(open), SCMP_SYS(openat), SCMP_SYS(close), SCMP_SYS(lseek),
    SCMP_SYS(stat), SCMP_SYS(fstat), SCMP_SYS(lstat), SCMP_SYS(newfstatat), SCMP_SYS(statx),
    SCMP_SYS(fstatfs), SCMP_SYS(access), SCMP_SYS(faccessat), SCMP_SYS(faccessat2),
    SCMP_SYS(getcwd), SCMP_SYS(readlink), SCMP_SYS(readlinkat), SCMP_SYS(getdents64),
    SCMP_SYS(fcntl), SCMP_SYS(dup), SCMP_SYS(ftruncate), SCMP_SYS(fallocate), SCMP_SYS(fsync),
    SCMP_SYS(fdatasync), SCMP_SYS(msync), SCMP_SYS(fadvise64), SCMP_SYS(mkdir), SCMP_SYS(mkdirat),
    SCMP_SYS(rmdir), SCMP_SYS(unlink), SCMP_SYS(unlinkat), SCMP_SYS(umask),
    // memory; mmap and mprotect have rules of their own
    SCMP_SYS(brk), SCMP_SYS(munmap), SCMP_SYS(mremap), SCMP_SYS(madvise),
    // the process itself
    SCMP_SYS(exit), SCMP_SYS(exit_group), SCMP_SYS(getpid), SCMP_SYS(getppid), SCMP_SYS(gettid),
    SCMP_SYS(getuid), SCMP_SYS(geteuid), SCMP_SYS(getgid), SCMP_SYS(getegid),
    SCMP_SYS(rt_sigaction), SCMP_SYS(rt_sigprocmask), SCMP_SYS(rt_sigreturn), SCMP_SYS(sigaltstack),
    SCMP_SYS(futex), SCMP_SYS(set_robust_list), SCMP_SYS(rseq), SCMP_SYS(sched_yield),
    SCMP_SYS(sched_getaffinity), SCMP_SYS(getrlimit), SCMP_SYS(getrusage), SCMP_SYS(sysinfo),
    SCMP_SYS(uname), SCMP_SYS(getrandom), SCMP_SYS(clock_gettime), SCMP_SYS(clock_getres),
    SCMP_SYS(clock_nanosleep), SCMP_SYS(nanosleep), SCMP_SYS(gettimeofday), SCMP_SYS(time),
    SCMP_SYS(restart_syscall)};

// Calls on existing sockets.
constexpr std::array kTalkingCalls = {
    SCMP_SYS(recvfrom),    SCMP_SYS(sendto),      SCMP_SYS(poll),       SCMP_SYS(ppoll),
    SCMP_SYS(select),      SCMP_SYS(pselect6),    SCMP_SYS(setsockopt), SCMP_SYS(getsockopt),
    SCMP_SYS(getpeername), SCMP_SYS(getsockname), SCMP_SYS(shutdown),   SCMP_SYS(recvmsg)};

// Calls, beside prlimit64, that only confine_to() makes.
constexpr std::array kConfiningCalls = {
    SCMP_SYS(landlock_create_ruleset), SCMP_SYS(landlock_add_rule),
    SCMP_SYS(landlock_restrict_self), SCMP_SYS(setrlimit), SCMP_SYS(seccomp)};

class Filter {
 public:
  explicit Filter(std::uint32_t otherwise) : context_(::seccomp_init(otherwise)) {
    if (context_ == nullptr) throw Error(ErrorCode::kInternal, "seccomp_init failed.");
    // confine_ahead() has set it already; loading the second filter must not set it again.
    check(::seccomp_attr_set(context_, SCMP_FLTATR_CTL_NNP, 0));
  }
  ~Filter() { ::seccomp_release(context_); }
  Filter(const Filter&) = delete;
  Filter& operator=(const Filter&) = delete;

  void allow(int call) {
    check(::seccomp_rule_add_array(context_, SCMP_ACT_ALLOW, call, 0, nullptr));
  }
  // If all conditions hold.
  void allow(int call, std::initializer_list<scmp_arg_cmp> conditions) {
    check(::seccomp_rule_add_array(context_, SCMP_ACT_ALLOW, call,
                                   static_cast<unsigned>(conditions.size()), conditions.begin()));
  }
  void fail(int call, int error) {
    check(::seccomp_rule_add_array(context_, SCMP_ACT_ERRNO(error), call, 0, nullptr));
  }
  void forbid(int call) { fail(call, EPERM); }
  void load() { check(::seccomp_load(context_)); }

 private:
  static void check(int result) {
    if (result < 0) throw_system_error("seccomp", -result);
  }

  scmp_filter_ctx context_;
};

scmp_arg_cmp argument_is(unsigned index, std::uint64_t value) {
  return {index, SCMP_CMP_EQ, value, 0};
}

scmp_arg_cmp argument_is_without(unsigned index, std::uint64_t bits) {
  return {index, SCMP_CMP_MASKED_EQ, bits, 0};
}

// Memory never becomes executable, and RLIMIT_DATA counts all of it: neither shared memory that no
// file backs nor memory that grows as a stack does.
void allow_memory(Filter& filter) {
  const scmp_arg_cmp not_executable = argument_is_without(2, PROT_EXEC);
  filter.allow(SCMP_SYS(mprotect), {not_executable});
  filter.allow(SCMP_SYS(mmap),
               {not_executable, argument_is_without(3, MAP_SHARED | MAP_GROWSDOWN)});
  filter.allow(SCMP_SYS(mmap),
               {not_executable, argument_is_without(3, MAP_ANONYMOUS | MAP_GROWSDOWN)});
}

// Activities of a process other than reading and writing files.
enum class Doing { kNothing, kTalk, kThreads };

void filter_calls(Doing doing) {
  Filter filter(SCMP_ACT_ERRNO(EPERM));
  if (doing == Doing::kTalk) {
    for (const int call : kTalkingCalls) filter.allow(call);
  }
  if (doing == Doing::kThreads) {
    // A thread, never a process. seccomp cannot inspect clone3; without it the C library uses
    // clone.
    filter.allow(SCMP_SYS(clone), {{0, SCMP_CMP_MASKED_EQ, CLONE_THREAD, CLONE_THREAD}});
    filter.fail(SCMP_SYS(clone3), ENOSYS);
    filter.allow(SCMP_SYS(sched_setaffinity));
    filter.allow(SCMP_SYS(recvmsg));  // it has only one socket
    filter.allow(SCMP_SYS(prctl), {argument_is(0, PR_SET_NAME)});
  }
  for (const int call : kAllowedCalls) filter.allow(call);
  allow_memory(filter);
  // For confine_to(), which then forbids it.
  for (const int call : kConfiningCalls) filter.allow(call);
  filter.allow(SCMP_SYS(prlimit64), {argument_is(0, 0)});  // the calling process
  // abort() signals its own thread.
  filter.allow(SCMP_SYS(tgkill), {argument_is(0, static_cast<std::uint64_t>(::getpid()))});
  filter.allow(SCMP_SYS(prctl), {argument_is(0, PR_SET_VMA)});  // malloc names its memory
  filter.load();
}

// A second filter: a call must pass both.
void forbid_confining() {
  Filter filter(SCMP_ACT_ALLOW);
  for (const int call : kConfiningCalls) filter.forbid(call);
  filter.forbid(SCMP_SYS(prlimit64));
  filter.load();
}

// --- The process itself --------------------------------------------------------------------------

void become_first_victim() {
  const Descriptor file(::open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC));
  // Without that file the kernel chooses as usual.
  if (file.number() >= 0) [[maybe_unused]]
    const auto count = ::write(file.number(), "1000", 4);
}

}  // namespace

bool has_landlock() { return landlock_version() >= 1; }

namespace {

// Root could raise its limits again. Others have none, and may be denied the call.
void drop_capabilities() {
  __user_cap_header_struct header = {.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
  std::array<__user_cap_data_struct, _LINUX_CAPABILITY_U32S_3> capabilities = {};
  require(::syscall(SYS_capget, &header, capabilities.data()) == 0, "capget");
  const bool has_any = std::ranges::any_of(
      capabilities, [](const auto& each) { return each.permitted != 0 || each.inheritable != 0; });
  if (!has_any) return;
  capabilities = {};
  require(::syscall(SYS_capset, &header, capabilities.data()) == 0, "capset");
}

void confine_process(Doing doing) {
  constexpr std::uint64_t kMostOpenFiles = 64;
  become_first_victim();
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_NOFILE, kMostOpenFiles);
  require(::prctl(PR_SET_DUMPABLE, 0) == 0, "prctl");
  require(::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0, "prctl");
  filter_calls(doing);
}

}  // namespace

void confine_ahead() { confine_process(Doing::kNothing); }

void confine_ahead_to_talk() { confine_process(Doing::kTalk); }

void confine_job(std::uint64_t file_bytes) {
  drop_capabilities();
  confine_process(Doing::kThreads);
  limit(RLIMIT_FSIZE, file_bytes);
  std::signal(SIGXFSZ, SIG_IGN);  // as in limit_resources()
  restrict_files({}, {});
}

MemoryLimit::MemoryLimit(std::uint64_t most_more_bytes)
    : usage_(::open("/proc/self/statm", O_RDONLY | O_CLOEXEC)) {
  require(usage_.number() >= 0, "open");
  if constexpr (kLimitMemory) limit(RLIMIT_DATA, with_present(most_more_bytes));
}

void MemoryLimit::set(std::uint64_t more_bytes) const {
  if constexpr (!kLimitMemory) return;
  rlimit bounds = {};
  require(::getrlimit(RLIMIT_DATA, &bounds) == 0, "getrlimit");
  bounds.rlim_cur = std::min<rlim_t>(bounds.rlim_max, with_present(more_bytes));
  require(::setrlimit(RLIMIT_DATA, &bounds) == 0, "setrlimit");
}

std::uint64_t MemoryLimit::with_present(std::uint64_t more_bytes) const {
  std::array<char, 256> text = {};
  require(::pread(usage_.number(), text.data(), text.size() - 1, 0) > 0, "pread");
  std::istringstream numbers(text.data());
  std::uint64_t present = 0;  // in pages; the sixth number is data and stack
  for (int number = 0; number < 6; ++number) numbers >> present;
  return sum({present * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE)), more_bytes});
}

void confine_to(const Confinement& confinement) {
  limit_resources(confinement);
  restrict_files(confinement.readable, confinement.writable);
  forbid_confining();
}

}  // namespace isomesh::process
