// How the command names what is on the server, and how it ends.
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "base/descriptor.h"
#include "tests/api/command.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::Not;

using CommandReachTest = CommandTest;

TEST_F(CommandReachTest, IdsMayBeShortened) {
  const Job job = finished_job(daemon_);
  const std::string volume = job.parameters.volume;
  const std::string short_volume = volume.substr(0, 8);
  const std::string end_of_job = job.id.substr(job.id.size() - 6);
  for (const std::string& line :
       {"info " + short_volume, "labels " + short_volume, "estimate --iso 100 " + short_volume,
        "submit --iso 100 " + short_volume, "rename " + short_volume + " ball",
        "status " + job.id.substr(0, 20), "wait " + end_of_job, "fetch -o @out.drc " + end_of_job,
        "cancel " + job.id.substr(0, 20)}) {
    const Finished result = command(line);
    EXPECT_EQ(result.status, 0) << line << ": " << result.errors;
  }
  EXPECT_THAT(command("list").output, HasSubstr("ball"));
  // It serves completion, so it tells nothing rather than late.
  const auto is_offered = [&](const std::string& kind, const std::string& id) {
    return eventually(
        [&] { return command("ids " + kind).output.find(id + '\n') != std::string::npos; });
  };
  EXPECT_TRUE(is_offered("volumes", volume));
  EXPECT_TRUE(is_offered("jobs", job.id));

  const Finished none = command("info ffff0000ffff");
  EXPECT_EQ(none.status, 1);
  EXPECT_THAT(none.errors, HasSubstr("there is no volume whose id begins or ends with"));
  // Ids of jobs begin with the time.
  const Job other = finished_job(daemon_);
  std::size_t same = 0;
  while (other.id[same] == job.id[same]) ++same;
  ASSERT_GE(same, 4U);
  const Finished several = command("cancel " + job.id.substr(0, same));
  EXPECT_EQ(several.status, 1);
  EXPECT_THAT(several.errors, HasSubstr("is ambiguous"));
  EXPECT_THAT(several.errors, HasSubstr(job.id));
  EXPECT_THAT(several.errors, HasSubstr(other.id));

  EXPECT_EQ(command("erase " + short_volume).status, 0);
  EXPECT_TRUE(daemon_.client().volumes().empty());
}

TEST_F(CommandReachTest, MeshTakesAStoredVolume) {
  const std::string id = upload().substr(0, 10);
  const Finished result = command("mesh --iso 100 -o @stored.stl " + id);
  ASSERT_EQ(result.status, 0) << result.errors;
  ASSERT_EQ(command("mesh @sphere.raw $raw --iso 100 -o @sent.stl").status, 0);
  EXPECT_EQ(read_file(folder_ / "stored.stl"), read_file(folder_ / "sent.stl"));
  const Finished dry = command("mesh --iso 100 --dry-run " + id);
  EXPECT_EQ(dry.status, 0) << dry.errors;
  EXPECT_EQ(daemon_.client().volumes().size(), 1U) << "a dry run keeps what was stored before";
  const Finished absent = command("mesh ffff0000ffff --iso 100 -o @absent.stl");
  EXPECT_EQ(absent.status, 1);
  EXPECT_THAT(absent.errors, HasSubstr("no volume whose id"));
}

// Three flat slabs, which the server takes for labels.
TEST_F(CommandReachTest, NotesNameTheirInputAndTheOption) {
  constexpr std::size_t kSlab = 32 * 32 * 10;
  for (const char* name : {"a.raw", "b.raw"}) {
    std::string bytes(32 * 32 * 32, '\0');
    bytes.replace(kSlab, kSlab, kSlab, '\3');
    bytes.replace(2 * kSlab, kSlab, kSlab, name[0]);
    write_file(folder_ / name, bytes);
  }
  const Finished both =
      command("mesh @a.raw @b.raw -o @{name}.stl --dims 32,32,32 --type uint8 --iso 2");
  EXPECT_EQ(both.status, 0) << both.errors;
  EXPECT_THAT(both.errors, HasSubstr("isomesh: a: note: "));
  EXPECT_THAT(both.errors, HasSubstr("isomesh: b: note: "));
  EXPECT_THAT(both.errors, HasSubstr("--labels all"));
  EXPECT_THAT(both.errors, Not(HasSubstr("\"labels\": ")));
}

TEST_F(CommandReachTest, AnIsoValueBeyondTheSamplesIsExplained) {
  const Finished result = command("mesh @sphere.raw $raw --iso 9999 -o @out.stl");
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.errors, HasSubstr("isomesh: "));
  EXPECT_THAT(result.errors,
              HasSubstr("the surface is empty: the iso-value 9999 separates none of the samples"));
  EXPECT_THAT(result.errors, HasSubstr("which range from 0 to "));
  const std::string job = daemon_.client().jobs().jobs.at(0).id;
  EXPECT_THAT(command("wait " + job).errors, HasSubstr("which range from 0 to "));
}

// A shell ends its loop if the command has died by SIGINT, and goes on if it has exited.
TEST(CommandInterrupted, EndsTheShellsLoop) {
  const Daemon daemon;
  const TemporaryFolder folder;
  write_file(folder / "noise.raw", rough_upload().bytes);
  const std::string mesh =
      std::string(ISOMESH) + " --server " + daemon.url() + " mesh " +
      (folder / "noise.raw").string() +
      " --dims 48,48,48 --type uint8 --iso 50 --smoothing optimize --passes 1000 -o " +
      (folder / "out.drc").string();
  // env: a test that runs in the background has inherited that SIGINT is ignored.
  Process shell({"env", "--default-signal=INT", "bash", "-c",
                 "for round in 1 2; do " + mesh + "; echo round $round; done; echo end"});
  const auto is_running = [&] {
    const auto jobs = daemon.client().jobs({.state = JobState::kRunning}).jobs;
    return jobs.size() == 1 && jobs.front().stage == Stage::kSmooth;
  };
  ASSERT_TRUE(eventually(is_running));
  const std::set<pid_t> children = children_of(shell.pid());
  ASSERT_EQ(children.size(), 1U);
  // As a terminal does, to all of the foreground.
  shell.send_signal(SIGINT);
  ::kill(*children.begin(), SIGINT);
  EXPECT_EQ(shell.wait(), 128 + SIGINT);
  EXPECT_EQ(shell.output(), "");
  EXPECT_THAT(shell.errors(), HasSubstr("was cancelled"));
  EXPECT_EQ(daemon.client().jobs().jobs.size(), 1U);
}

// A daemon of the command's own, with temporary files in a folder.
class LocalCommandTest : public testing::Test {
 protected:
  LocalCommandTest() { std::filesystem::create_directory(folder_ / "tmp"); }

  std::vector<std::string> local(const RawUpload& upload, const std::vector<std::string>& more) {
    write_file(folder_ / "volume.raw", upload.bytes);
    return with(with({ISOMESH, "local", folder_ / "volume.raw", "-o", folder_ / "out.stl"}, more),
                upload.options);
  }

  const TemporaryFolder folder_;
  const std::vector<std::string> environment_ = {"TMPDIR=" + (folder_ / "tmp").string(),
                                                 "ISOMESH_SERVER=http://127.0.0.1:1",
                                                 "ISOMESH_LISTEN=nonsense"};
};

TEST_F(LocalCommandTest, MeshesWithoutAServerAndLeavesNothing) {
  const std::vector<std::string> words = local(sphere_upload(), {"--iso", "100"});
  const Finished result = run(words, environment_);
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_GT(read_file(folder_ / "out.stl").size(), 1000U);
  EXPECT_TRUE(std::filesystem::is_empty(folder_ / "tmp"));

  const Finished lost = run(words, {"TMPDIR=/no/such/folder"});
  EXPECT_EQ(lost.status, 1);
  EXPECT_THAT(lost.errors, HasSubstr("TMPDIR=/no/such/folder: No such file"));

  const Finished broken = run(with(words, {"--daemon", "/bin/false"}), environment_);
  EXPECT_EQ(broken.status, 3);
  EXPECT_THAT(broken.errors, HasSubstr("/bin/false did not start"));
  EXPECT_TRUE(std::filesystem::is_empty(folder_ / "tmp"));
}

// If it is killed it cannot remove its folder. The next run does.
TEST_F(LocalCommandTest, EndsItsDaemonHoweverItEnds) {
  for (const int signal : {SIGINT, SIGKILL}) {
    Process command(local(long_upload(), {"--iso", "50", "--passes", "1000"}), environment_);
    ASSERT_TRUE(eventually([&] { return children_of(command.pid()).size() == 1; }));
    const pid_t daemon = *children_of(command.pid()).begin();
    ASSERT_TRUE(eventually([&] { return program_of(daemon) == "isomeshd"; }));
    ASSERT_TRUE(eventually([&] {
      return std::ranges::any_of(files_below(folder_ / "tmp"), [](const std::string& name) {
        return name.find("/data/") != std::string::npos;
      });
    }));
    command.send_signal(signal);
    EXPECT_NE(command.wait(), 0);
    EXPECT_TRUE(eventually([&] { return program_of(daemon).empty(); })) << "signal " << signal;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out.stl"));
  }
  EXPECT_FALSE(std::filesystem::is_empty(folder_ / "tmp"));
  // The processes of the daemon end with it, but not in the same moment.
  EXPECT_TRUE(eventually([&] {
    const Finished next = run(local(sphere_upload(), {"--iso", "100"}), environment_);
    EXPECT_EQ(next.status, 0) << next.errors;
    return std::filesystem::is_empty(folder_ / "tmp");
  }));
}

TEST(CommandWithoutServer, IsStatus3) {
  std::string url;
  {
    Daemon gone;
    url = gone.url();
    gone.stop();
  }
  const Finished result = run({ISOMESH, "--server", url, "list"});
  EXPECT_EQ(result.status, 3);
  EXPECT_FALSE(result.errors.empty());
  EXPECT_EQ(run({ISOMESH, "list"}, {"ISOMESH_SERVER=" + url}).status, 3);
  const Finished absent = run({ISOMESH, "--server", "unix:/no/such/socket", "list"});
  EXPECT_EQ(absent.status, 3);
  EXPECT_THAT(absent.errors, HasSubstr("start isomeshd, or use `isomesh local`"));
  EXPECT_EQ(run({ISOMESH, "--server", "nonsense", "list"}).status, 2);
}

// Standard input is a pipe that the test holds open.
class CommandReadsTest : public CommandTest {
 protected:
  CommandReadsTest() {
    std::filesystem::create_directory(folder_ / "tmp");
    const std::string pipe = folder_ / "pipe";
    EXPECT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    pipe_ = Descriptor(::open(pipe.c_str(), O_RDWR | O_CLOEXEC));
  }

  // `environment` is an option of env(1). Returns when the first half of the sphere was copied.
  void begin(const std::string& environment) {
    std::string words = "exec " ISOMESH " --server " + daemon_.url() + " mesh - --iso 100 -o " +
                        (folder_ / "out.stl").string();
    for (const std::string& option : sphere_.options) words += ' ' + option;
    words += " < " + (folder_ / "pipe").string();
    command_.emplace(std::vector<std::string>{"env", environment, "bash", "-c", words},
                     std::vector<std::string>{"TMPDIR=" + (folder_ / "tmp").string()});
    send(std::string_view(sphere_.bytes).substr(0, half_));
    ASSERT_TRUE(eventually([&] {
      return std::ranges::any_of(files_below(folder_ / "tmp"), [&](const std::string& name) {
        return name.ends_with(".volume") && read_file(folder_ / "tmp" / name).size() == half_;
      });
    }));
  }

  void send(std::string_view bytes) const { write_all(pipe_, std::as_bytes(std::span(bytes))); }

  const std::size_t half_ = sphere_.bytes.size() / 2;
  Descriptor pipe_;
  std::optional<Process> command_;
};

TEST_F(CommandReadsTest, StandardInputUntilItIsStoppedAndLeavesNoCopy) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    begin("--default-signal=INT,TERM,HUP");
    command_->send_signal(signal);
    EXPECT_EQ(command_->wait(), 128 + signal);
    EXPECT_EQ(command_->errors(), "isomesh: interrupted\n");
    EXPECT_THAT(files_below(folder_ / "tmp"), testing::IsEmpty());
  }
}

// As nohup does it.
TEST_F(CommandReadsTest, StandardInputToItsEndIfItIsToOutliveItsTerminal) {
  begin("--ignore-signal=HUP");
  command_->send_signal(SIGHUP);
  send(std::string_view(sphere_.bytes).substr(half_));
  pipe_ = Descriptor();
  EXPECT_EQ(command_->wait(), 0) << command_->errors();
  EXPECT_GT(std::filesystem::file_size(folder_ / "out.stl"), 1000U);
}

}  // namespace
}  // namespace isomesh
