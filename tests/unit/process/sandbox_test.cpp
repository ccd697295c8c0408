// Tests of what confinement forbids, in confined processes that exit with the result. Imports under
// confinement are tested with the runner that starts them.
#include "server/process/sandbox.h"

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <ctime>
#include <functional>
#include <thread>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "server/process/child.h"
#include "server/process/passing.h"
#include "tests/support/files.h"

namespace isomesh::process {
namespace {

using test::TemporaryFolder;

class Sandbox : public testing::Test {
 protected:
  Sandbox() { test::write_file(folder_ / "upload", "bytes"); }

  Confinement confinement() const {
    return {.readable = folder_ / "upload",
            .writable = scratch_.path(),
            .memory_bytes = std::uint64_t{256} << 20,
            .file_bytes = 4096,
            .time = std::chrono::seconds(60)};
  }

  // True if `holds` returns true in a confined process.
  bool confined(const std::function<bool()>& holds) const { return confined(confinement(), holds); }

  static bool confined(const Confinement& confinement, const std::function<bool()>& holds) {
    return ends_well([&] {
      confine_ahead();
      confine_to(confinement);
      return holds();
    });
  }

  // True if `holds` returns true in a process of its own.
  static bool ends_well(const std::function<bool()>& holds) {
    const int status = status_of(holds);
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }

  static int status_of(const std::function<bool()>& holds) {
    const pid_t child = ::fork();
    if (child == 0) ::_exit(holds() ? 0 : 1);
    int status = -1;
    EXPECT_EQ(::waitpid(child, &status, 0), child);
    return status;
  }

  const TemporaryFolder folder_;
  const TemporaryFolder scratch_;
};

// True when a call has failed with that error.
bool fails(long result, int error) { return result < 0 && errno == error; }

TEST_F(Sandbox, LeavesTheUploadAndTheScratchFolder) {
  EXPECT_TRUE(confined([&] { return ::open((folder_ / "upload").c_str(), O_RDONLY) >= 0; }));
  EXPECT_TRUE(confined([&] {
    const auto path = scratch_ / "new";
    const int file = ::open(path.c_str(), O_WRONLY | O_CREAT, 0600);
    return file >= 0 && ::write(file, "x", 1) == 1 && ::unlink(path.c_str()) == 0;
  }));
}

TEST_F(Sandbox, TakesOtherFilesWhereTheKernelCan) {
  test::write_file(folder_ / "other", "bytes");
  const auto reads_other = [&] { return ::open((folder_ / "other").c_str(), O_RDONLY) >= 0; };
  EXPECT_EQ(confined(reads_other), !has_landlock());
}

TEST_F(Sandbox, TakesSocketsAndOtherProcesses) {
  EXPECT_TRUE(confined([] { return fails(::socket(AF_INET, SOCK_STREAM, 0), EPERM); }));
  EXPECT_TRUE(confined([] { return fails(::socket(AF_UNIX, SOCK_STREAM, 0), EPERM); }));
  EXPECT_TRUE(confined([] { return fails(::fork(), EPERM); }));
  EXPECT_TRUE(confined([] { return fails(::kill(::getppid(), 0), EPERM); }));
}

TEST_F(Sandbox, TakesTheWayBack) {
  EXPECT_TRUE(confined([] { return fails(::prctl(PR_SET_DUMPABLE, 1), EPERM); }));
  EXPECT_TRUE(confined([] {
    const rlimit more = {.rlim_cur = RLIM_INFINITY, .rlim_max = RLIM_INFINITY};
    return ::setrlimit(RLIMIT_FSIZE, &more) != 0;
  }));
}

TEST_F(Sandbox, TakesSocketsAndProcessesAhead) {
  EXPECT_TRUE(ends_well([] {
    confine_ahead();
    return fails(::socket(AF_UNIX, SOCK_STREAM, 0), EPERM) && fails(::fork(), EPERM) &&
           fails(::kill(::getppid(), 0), EPERM) && fails(::prctl(PR_SET_DUMPABLE, 1), EPERM) &&
           fails(::execl("/bin/true", "true", nullptr), EPERM);
  }));
}

TEST_F(Sandbox, LeavesATalkToTheSocketsThatAreThere) {
  const SocketPair sockets = make_socket_pair();
  EXPECT_TRUE(ends_well([&] {
    confine_ahead_to_talk();
    confine_to(confinement());
    const int on = 1;
    char byte = 0;
    return ::send(sockets.ours.number(), "x", 1, MSG_NOSIGNAL) == 1 &&
           ::recv(sockets.theirs.number(), &byte, 1, 0) == 1 &&
           ::setsockopt(sockets.ours.number(), SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on) == 0 &&
           fails(::socket(AF_INET, SOCK_STREAM, 0), EPERM) &&
           fails(::connect(sockets.ours.number(), nullptr, 0), EPERM) &&
           fails(::accept(sockets.ours.number(), nullptr, nullptr), EPERM) &&
           fails(::fork(), EPERM);
  }));
}

TEST_F(Sandbox, CannotBeConfinedTwice) {
  EXPECT_TRUE(confined([&] {
    try {
      confine_to(confinement());
    } catch (const std::exception&) {
      return true;
    }
    return false;
  }));
  EXPECT_TRUE(confined([] {
    return fails(::syscall(SYS_landlock_create_ruleset, nullptr, 0, 1), EPERM) &&
           fails(::syscall(SYS_seccomp, 0, 0, nullptr), EPERM) &&
           fails(::syscall(SYS_prlimit64, ::getppid(), RLIMIT_CPU, nullptr, nullptr), EPERM);
  }));
}

TEST_F(Sandbox, LimitsAFileAndSaysSoWithoutASignal) {
  EXPECT_TRUE(confined([&] {
    const int file = ::open((scratch_ / "large").c_str(), O_WRONLY | O_CREAT, 0600);
    return ::lseek(file, 4096, SEEK_SET) == 4096 && fails(::write(file, "x", 1), EFBIG);
  }));
}

TEST_F(Sandbox, LeavesFewOpenFiles) {
  EXPECT_TRUE(confined([&] {
    for (int file = 0; file < 64; ++file) {
      if (fails(::open((folder_ / "upload").c_str(), O_RDONLY), EMFILE)) return true;
    }
    return false;
  }));
}

TEST_F(Sandbox, EndsAProcessThatTakesTooMuchOfTheProcessor) {
  Confinement brief = confinement();
  brief.time = std::chrono::seconds(1);
  const int status = status_of([&] {
    confine_ahead();
    confine_to(brief);
    std::atomic<unsigned> turns = 0;
    while (true) ++turns;
    return true;
  });
  EXPECT_TRUE(is_out_of_time(status)) << how_it_ended(status);
}

TEST_F(Sandbox, TellsTheEndOfTheTimeFromOtherEnds) {
  const auto status_of_signal = [](int signal) {
    return status_of([signal] { return std::raise(signal) == 0; });
  };
  const int late = status_of_signal(SIGXCPU);
  EXPECT_TRUE(is_out_of_time(late));
  EXPECT_EQ(how_it_ended(late), "because it took too much processor time");
  const int killed = status_of_signal(SIGKILL);
  EXPECT_FALSE(is_out_of_time(killed));
  EXPECT_EQ(how_it_ended(killed), "with signal 9 (killed)");
  EXPECT_FALSE(is_out_of_time(std::nullopt));
}

TEST_F(Sandbox, SaysWhenAFolderCannotBeAllowed) {
  Confinement nowhere = confinement();
  nowhere.writable = scratch_ / "nowhere";
  const int status = status_of([&] {
    try {
      confine_ahead();
      confine_to(nowhere);
    } catch (const std::exception&) {
      return true;
    }
    return false;
  });
  // A kernel without Landlock is not asked to allow anything.
  EXPECT_EQ(WIFEXITED(status) && WEXITSTATUS(status) == 0, has_landlock());
}

// --- Jobs

class JobSandbox : public Sandbox {
 protected:
  bool confined(const std::function<bool()>& holds) const {
    return ends_well([&] {
      confine_job();
      return holds();
    });
  }
};

TEST_F(JobSandbox, LeavesWhatIsOpenToRead) {
  const Descriptor upload(::open((folder_ / "upload").c_str(), O_RDONLY));
  char byte = 0;
  EXPECT_TRUE(confined([&] { return ::pread(upload.number(), &byte, 1, 0) == 1; }));
  EXPECT_EQ(confined([&] { return ::open((folder_ / "upload").c_str(), O_RDONLY) >= 0; }),
            !has_landlock());
  // Nor does what is open lead to more than there is of it.
  const std::string itself = "/proc/self/fd/" + std::to_string(upload.number());
  EXPECT_EQ(confined([&] { return ::open(itself.c_str(), O_RDWR) >= 0; }), !has_landlock());
}

TEST_F(JobSandbox, LeavesTheWayInForDescriptors) {
  const SocketPair sockets = make_socket_pair();
  const Descriptor upload(::open((folder_ / "upload").c_str(), O_RDONLY));
  ASSERT_EQ(send_with(sockets.ours.number(), "upload", upload.number()), 6);
  EXPECT_TRUE(confined([&] {
    std::array<char, 64> piece = {};
    const Received received = receive(sockets.theirs.number(), piece);
    char byte = 0;
    return received.count == 6 && ::pread(received.passed.number(), &byte, 1, 0) == 1;
  }));
}

TEST_F(JobSandbox, LeavesNothingToWrite) {
  EXPECT_TRUE(confined([&] {
    std::signal(SIGXFSZ, SIG_IGN);
    const int file = ::open((folder_ / "new").c_str(), O_WRONLY | O_CREAT, 0600);
    return file < 0 || fails(::write(file, "x", 1), EFBIG);
  }));
  EXPECT_EQ(confined([&] { return ::unlink((folder_ / "upload").c_str()) == 0; }), !has_landlock());
}

TEST_F(JobSandbox, LeavesThreadsAndTakesProcessesAndSockets) {
  EXPECT_TRUE(confined([] {
    std::atomic<bool> has_run = false;
    std::jthread([&] { has_run = true; }).join();
    return has_run.load();
  }));
  EXPECT_TRUE(confined([] { return fails(::fork(), EPERM); }));
  EXPECT_TRUE(confined([] { return fails(::socket(AF_UNIX, SOCK_STREAM, 0), EPERM); }));
  EXPECT_TRUE(confined([] { return fails(::kill(::getppid(), 0), EPERM); }));
}

// RLIMIT_DATA counts private memory that is writable, and no stacks.
TEST_F(JobSandbox, TakesAllMemoryThatNoLimitCounts) {
  const auto mapped = [](int flags, int file) {
    return ::mmap(nullptr, 4096, PROT_READ, flags, file, 0) != MAP_FAILED;
  };
  const Descriptor upload(::open((folder_ / "upload").c_str(), O_RDONLY));
  EXPECT_TRUE(confined([&] {
    return mapped(MAP_PRIVATE | MAP_ANONYMOUS, -1) && mapped(MAP_PRIVATE, upload.number()) &&
           mapped(MAP_SHARED, upload.number());
  }));
  for (const int flags : {MAP_SHARED | MAP_ANONYMOUS, MAP_SHARED_VALIDATE | MAP_ANONYMOUS,
                          MAP_PRIVATE | MAP_ANONYMOUS | MAP_GROWSDOWN}) {
    EXPECT_TRUE(confined([&] { return !mapped(flags, -1) && errno == EPERM; })) << flags;
  }
  EXPECT_TRUE(confined([] { return fails(::memfd_create("memory", 0), EPERM); }));
  EXPECT_TRUE(confined([] { return fails(::shmget(IPC_PRIVATE, 4096, 0600), EPERM); }));
}

// Under the sanitizers memory is not limited.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

TEST_F(JobSandbox, LimitsMemoryAgainAndAgain) {
  const auto can_have = [](std::size_t bytes) {
    void* const memory =
        ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) return false;
    ::munmap(memory, bytes);
    return true;
  };
  constexpr std::size_t kMebibyte = 1 << 20;
  EXPECT_TRUE(ends_well([&] {
    const MemoryLimit limit(300 * kMebibyte);
    confine_job();
    limit.set(64 * kMebibyte);
    if (!can_have(60 * kMebibyte) || can_have(80 * kMebibyte)) return false;
    limit.set(256 * kMebibyte);
    if (!can_have(200 * kMebibyte)) return false;
    limit.set(1000 * kMebibyte);
    if (!can_have(280 * kMebibyte) || can_have(320 * kMebibyte)) return false;
    limit.set(64 * kMebibyte);
    return !can_have(80 * kMebibyte);
  }));
}

// Memory of the process does not count what is set aside in a file, but the file has a limit.
TEST_F(JobSandbox, WritesOnlySoMuchToWhatIsOpen) {
  const Descriptor spool(::open((folder_ / "spool").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  EXPECT_TRUE(ends_well([&] {
    confine_job(100);
    const std::array<char, 60> bytes = {};
    return ::pwrite(spool.number(), bytes.data(), 60, 0) == 60 &&
           fails(::pwrite(spool.number(), bytes.data(), 60, 100), EFBIG);
  }));
}

// Root may raise limits, unless it has no capabilities.
TEST_F(JobSandbox, CannotRaiseTheMostMemory) {
  EXPECT_TRUE(ends_well([&] {
    const MemoryLimit limit(std::uint64_t{64} << 20);
    confine_job();
    const rlimit more = {.rlim_cur = RLIM_INFINITY, .rlim_max = RLIM_INFINITY};
    return fails(::setrlimit(RLIMIT_DATA, &more), EPERM);
  }));
}

#endif

}  // namespace
}  // namespace isomesh::process
