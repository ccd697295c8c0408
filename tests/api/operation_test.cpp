// Starting, listening, and what a restart keeps.
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include "base/descriptor.h"
#include "proto/json.h"
#include "server/net/address.h"
#include "server/net/listener.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"
#include "tests/support/step.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;

TEST(Start, TellsWhereItListensOnItsFirstLine) {
  const Daemon daemon;
  EXPECT_THAT(daemon.url(), testing::MatchesRegex("http://127\\.0\\.0\\.1:[1-9][0-9]*"));
  EXPECT_EQ(daemon.get("/livez").body, "ok\n");
  // The first check may take longer than the answer waits for it.
  EXPECT_TRUE(eventually([&] { return daemon.get("/readyz").body == "ok\n"; }));
}

// A file that the daemon opens must not become its standard output or its log.
TEST(Start, WithoutStandardDescriptors) {
  const TemporaryFolder folder;
  const std::string url = "unix:" + (folder / "socket").string();
  Process daemon({"/bin/sh", "-c", R"(exec "$@" <&- >&- 2>&-)", "sh", ISOMESHD, "--listen", url,
                  "--data", folder / "data"});
  // It says nothing, and its socket is there before it listens.
  ASSERT_TRUE(eventually([&] {
    try {
      return answer_to(url, request("GET", "/livez", "")).status == 200;
    } catch (const std::exception&) {
      return false;
    }
  }));
  const RawUpload raw = sphere_upload();
  const std::string body = request("POST", "/v1/volumes?" + raw.query, raw.bytes);
  EXPECT_EQ(answer_to(url, body).status, 201);
  for (const std::string number : {"0", "1", "2"}) {
    EXPECT_EQ(
        std::filesystem::read_symlink("/proc/" + std::to_string(daemon.pid()) + "/fd/" + number),
        "/dev/null");
  }
  daemon.send_signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0);
}

// As an upgrade of the package replaces them, a while before it restarts the daemon.
TEST(Start, TheProgramsMayBeReplacedAfterIt) {
  namespace fs = std::filesystem;
  const TemporaryFolder folder;
  const fs::path programs = folder / "programs";
  fs::create_directory(programs);
  for (const std::string name : {"isomeshd", "isomesh-import", "isomesh-job"}) {
    fs::copy_file(fs::path(ISOMESHD).parent_path() / name, programs / name);
  }
  const std::string replace = "shift; exec " + (programs / "isomeshd").string() + " \"$@\"";
  const Daemon daemon(folder / "data", "127.0.0.1:0", {}, {"bash", "-c", replace, "bash"});
  for (const std::string name : {"isomesh-import", "isomesh-job"}) {
    fs::remove(programs / name);
    fs::copy_file("/bin/false", programs / name);
  }
  EXPECT_EQ(finished_job(daemon).state, JobState::kSucceeded);
}

TEST(Start, HelpAndVersion) {
  const Finished help = run({ISOMESHD, "--help"});
  EXPECT_EQ(help.status, 0);
  for (const std::string option : {"--listen", "--data", "--workers", "--config"}) {
    EXPECT_THAT(help.output, HasSubstr(option));
  }
  const Finished version = run({ISOMESHD, "--version"});
  EXPECT_EQ(version.status, 0);
  EXPECT_THAT(version.output, testing::ContainsRegex("[0-9]+\\.[0-9]+\\.[0-9]+"));
}

TEST(Start, TellsItsVersion) {
  const Daemon daemon;
  const Answer answer = daemon.get("/version");
  EXPECT_EQ(answer.status, 200);
  EXPECT_THAT(answer.body,
              HasSubstr("\"version\":\"" + run({ISOMESHD, "--version"}).output.substr(0, 5) + '"'));
  EXPECT_THAT(answer.body, HasSubstr("\"orders\":false"));
  EXPECT_THAT(daemon.get("/metrics").body, HasSubstr("\nisomesh_build_info{"));
}

TEST(Start, EveryReasonNotToStartBeginsWithTheProgramsName) {
  const TemporaryFolder folder;
  const Daemon other;
  write_file(folder / "config.toml", "tokns = 1\n");
  write_file(folder / "tokens", "");
  for (const std::vector<std::string>& wrong : std::vector<std::vector<std::string>>{
           {"--no-such-option"},
           {"--listen", "127.0.0.1:99999"},
           {"--workers", "65"},
           {"--keep-days", "nan"},
           {"--callback-retry-seconds", "nan"},
           {"--max-disk=-1"},
           {"--disk-reserve=-1"},
           {"--max-disk", "99999999999999999999"},
           {"--max-upload", "0"},
           {"--cors-origin", "viewer.example"},
           {"--cors-origin", "https://viewer.example/"},
           {"--allow-host", "a b"},
           {"--config", folder / "config.toml"},
           {"--config", folder / "absent"},
           {"--listen", "nowhere"},
           {"--listen", other.url().substr(std::string("http://").size())},
           {"--tokens", folder / "tokens"},
           {"--store", "mysql://nowhere"},
           {"--log-level", "off", "--listen", "nowhere"},
           {"check", "--listen", "nowhere"},
           {"token", "list"},
           {"restore", folder / "absent"}}) {
    const Finished result = run(with({ISOMESHD, "--data", folder / "data"}, wrong));
    EXPECT_NE(result.status, 0) << wrong[0];
    EXPECT_THAT(result.errors, testing::StartsWith("isomeshd: ")) << wrong[0];
    EXPECT_THAT(result.output, testing::Not(HasSubstr("listening"))) << wrong[0];
  }
  const Finished as_json = run({ISOMESHD, "--data", folder / "data", "--listen", "nowhere",
                                "--log-format", "json", "--log-level", "off"});
  EXPECT_THAT(as_json.errors, testing::StartsWith("{"));
  EXPECT_THAT(as_json.errors, HasSubstr("\"text\":\"isomeshd: listen: "));
}

TEST(Start, OptionsComeFromTheEnvironmentAndFromAFileToo) {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  write_file(folder / "config.toml", "max-upload = 1234\n");
  Process process({ISOMESHD}, {"ISOMESH_LISTEN=127.0.0.1:0", "ISOMESH_DATA=" + data,
                               "ISOMESH_CONFIG=" + std::string(folder / "config.toml")});
  const Answer answer =
      answer_to(url_of(process), request("POST", "/v1/volumes", std::string(2000, 'x')));
  EXPECT_TRUE(is_problem(answer, ErrorCode::kTooLarge));
  EXPECT_THAT(answer.body, HasSubstr("1234"));
}

TEST(Start, AnUnknownVariableIsToldWithTheNearestName) {
  const TemporaryFolder folder;
  const Finished told =
      run({ISOMESHD, "--data", folder / "data", "check"},
          {"ISOMESH_WORKRS=3", "ISOMESH_WORKERS=4", "ISOMESH_TOKEN=for-clients", "ISOMESHER=1"});
  EXPECT_EQ(told.status, 0) << told.errors;
  EXPECT_THAT(told.errors, HasSubstr("ISOMESH_WORKRS"));
  EXPECT_THAT(told.errors, HasSubstr("Did you mean ISOMESH_WORKERS?"));
  EXPECT_EQ(std::ranges::count(told.errors, '\n'), 1) << told.errors;
}

// A daemon that ignored it would listen without tokens.
TEST(Configuration, AnUnknownKeyIsRefusedByName) {
  const TemporaryFolder folder;
  for (const std::string text : {"tokns = \"/etc/isomesh/tokens\"\n", "[server]\ntokns = 1\n"}) {
    write_file(folder / "config.toml", text);
    for (const std::vector<std::string>& words :
         std::vector<std::vector<std::string>>{{}, {"check"}, {"--check-config"}}) {
      const Finished refused =
          refused_start(folder / "data", with({"--config", folder / "config.toml"}, words));
      EXPECT_EQ(refused.status, 2) << text;
      EXPECT_THAT(refused.errors, testing::AnyOf(HasSubstr("\"tokns\""), HasSubstr("[server];")));
      EXPECT_EQ(refused.output, "");
    }
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "data"));
}

TEST(Configuration, IsToldWithoutAStart) {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  const std::string file = folder / "config.toml";
  write_file(file, "max-queue = 7\nlog-level = \"warn\"\nopen-network = true\n");
  const Finished told =
      run({ISOMESHD, "check", "--config", file, "--data", data}, {"ISOMESH_WORKERS=3"});
  EXPECT_EQ(told.status, 0) << told.errors;
  for (const std::string line : {"max-queue = 7\n", "workers = 3\n", "open-network = true\n",
                                 "log-level = \"warn\"\n", "# keep-days = 30\n"}) {
    EXPECT_THAT('\n' + told.output, HasSubstr('\n' + line));
  }
  EXPECT_THAT(told.output, HasSubstr("data = \"" + data + "\"\n"));
  EXPECT_EQ(
      run({ISOMESHD, "--check-config", "--config", file, "--data", data}, {"ISOMESH_WORKERS=3"})
          .output,
      told.output);
  EXPECT_FALSE(std::filesystem::exists(data));
  // The output is itself a valid configuration file.
  write_file(folder / "told.toml", told.output);
  const Finished again = run({ISOMESHD, "check", "--config", folder / "told.toml"});
  EXPECT_EQ(again.output, told.output) << again.errors;
}

// The output of `isomeshd check` with a file of --config of that text.
Finished checked(const TemporaryFolder& folder, const std::string& text) {
  write_file(folder / "config.toml", text);
  return run({ISOMESHD, "check", "--config", folder / "config.toml"});
}

// A folder that is not the one in the file would be empty.
TEST(Configuration, ValuesAreReadAsToml) {
  const TemporaryFolder folder;
  const std::vector<std::pair<std::string, std::string>> cases = {
      {R"(data = "/srv/ab#cd" # a comment)", R"(data = "/srv/ab#cd")"},
      {R"(data = 'x#y')", R"(data = "x#y")"},
      {R"(data = 'C:\x')", R"(data = "C:\\x")"},
      {R"(data = "a\"b\\c")", R"(data = "a\"b\\c")"},
      {R"(data = "x\ty")", R"(data = "x\u0009y")"},
      {R"(data = "\u00e9")", "data = \"\u00e9\""},
      {"data = \"\"\"\nx; y\"\"\"", R"(data = "x; y")"},
      {R"(data = "[a, b]")", R"(data = "[a, b]")"},
      {R"(data = "5")", R"(data = "5")"},
      {"max-upload = 8_000_000", "max-upload = 8000000"},
      {"max-upload = 0x10", "max-upload = 16"},
      {R"(max-upload = "1KiB")", "max-upload = 1024"},
      {"keep-days = 2.50", "keep-days = 2.5"},
      {"open-network = true", "open-network = true"},
      {R"(cors-origin = ["https://x", 'https://y'])",
       R"(cors-origin = ["https://x", "https://y"])"},
      {R"(cors-origin = "https://x,https://y")", R"(cors-origin = ["https://x", "https://y"])"},
      {R"(allow-host = "[2001:db8::1]")", R"(allow-host = "[2001:db8::1]")"},
      {"callback-allow = [\n  # none\n]", "# callback-allow = []"},
      {"tokens = \"\"", "# tokens = \"\""},
      {"disk-reserve = \"\"", "# disk-reserve = \"\""}};
  for (const auto& [text, line] : cases) {
    const Finished told = checked(folder, "# \xc2\xa7 1\r\n" + text + '\n');
    EXPECT_EQ(told.status, 0) << text << told.errors;
    EXPECT_THAT('\n' + told.output, HasSubstr('\n' + line + '\n')) << text;
  }
}

// As distinguished names and URLs have them.
TEST(Configuration, ValuesOfAnOptionThatMayBeRepeatedMayHaveCommas) {
  const TemporaryFolder folder;
  const std::string roles = R"(oidc-role = ["CN=ct,OU=clinic=user", "[it,all]=admin"])";
  const std::string parameter = R"(oidc-parameter = "claims={\"a\":1,\"b\":2}")";
  const std::string provider =
      "oidc-issuer = \"https://login.example\"\noidc-audience = \"isomesh\"\n";
  const std::vector<std::string> words = {ISOMESHD, "check", "--config", folder / "provider.toml"};
  write_file(folder / "provider.toml", provider);
  const std::string claims = R"(claims={"a":1,"b":2})";
  for (const Finished& told :
       {checked(folder, provider + roles + '\n' + parameter),
        run(with(words, {"--oidc-role", "CN=ct,OU=clinic=user", "--oidc-role", "[it,all]=admin",
                         "--oidc-parameter", claims})),
        run(words, {"ISOMESH_OIDC_ROLE=CN=ct,OU=clinic=user\n[it,all]=admin",
                    "ISOMESH_OIDC_PARAMETER=" + claims})}) {
    EXPECT_EQ(told.status, 0) << told.errors;
    EXPECT_THAT(told.output, HasSubstr('\n' + roles + '\n'));
    EXPECT_THAT(told.output, HasSubstr('\n' + parameter + '\n'));
  }
}

TEST(Configuration, AWrongLineIsToldWithItsNumber) {
  const TemporaryFolder folder;
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"data = /srv/x", "must be TOML"},
      {"open-network", "must be TOML"},
      {"data = \"x", "must be TOML"},
      {"data = 'x'\ndata = 'y'", "must be TOML"},
      {"data = \"\xff\"", "must be TOML"},
      {"data = 5", "data must be a string in quotes"},
      {"data = ['x']", "data must be a string in quotes"},
      {"data = 1979-05-27", "data must be a string in quotes"},
      {R"(data = "a\u0000b")", "U+0000"},
      {"data.x = 'y'", "data must be a string in quotes"},
      {"workers = true", "workers must be a number"},
      {"open-network = 1", "open-network must be true or false"},
      {"cors-origin = [1]", "cors-origin must be a string or a list of strings"},
      {"adopt = true", "\"adopt\" is only for the command line"},
      {"config = 'x'", "\"config\" is only for the command line"},
      {"[audit]\nverify = true", "no section [audit]"},
      {"[token.add]\nrole = 'admin'", "no section [token]"},
      {"[[pacs]]\nname = 'x'", "no section [pacs]"}};
  for (const auto& [text, message] : cases) {
    const Finished told = checked(folder, "\n" + text + '\n');
    EXPECT_EQ(told.status, 2) << text << told.output;
    EXPECT_THAT(told.errors, testing::ContainsRegex("the file of --config: line [23]: ")) << text;
    EXPECT_THAT(told.errors, HasSubstr(message)) << text;
  }
}

TEST(Configuration, EveryStringThatIsToldReadsBack) {
  const TemporaryFolder folder;
  const std::vector<std::string> parts = {
      "#",    "\"",     "\"\"\"", "'",      "\\",     "\\u",    "\\n",       "\n",
      "\r",   "\t",     "\x01",   "\x7f",   " ",      ",",      "=",         ";",
      "[",    "]",      "{",      "}",      "$",      "%",      "5",         ".",
      "true", "\u00e9", "\u0085", "\u2028", "\ufeff", "\ufffe", "\U0001f9e0"};
  std::mt19937 random(1);
  for (unsigned round = 0; round < 50; round += test::kStep) {
    std::string value;
    const auto count = 1 + random() % 6;
    for (std::size_t i = 0; i < count; ++i) value += parts[random() % parts.size()];
    const Finished told = run({ISOMESHD, "check", "--data=" + value, "--store", ""});
    ASSERT_EQ(told.status, 0) << value << told.errors;
    const Finished again = checked(folder, told.output);
    EXPECT_EQ(again.output, told.output) << value << again.errors;
  }
}

TEST(Configuration, NumbersThatTomlDoesNotHaveReadBack) {
  const TemporaryFolder folder;
  for (const std::string option :
       {"--workers=010", "--keep-days=.5", "--keep-days=1e3", "--keep-days=7.", "--keep-days=0.10",
        "--max-disk=18446744073709551615", "--max-disk=10000000000"}) {
    const Finished told = run({ISOMESHD, "check", option});
    ASSERT_EQ(told.status, 0) << option << told.errors;
    const Finished again = checked(folder, told.output);
    EXPECT_EQ(again.output, told.output) << option << again.errors;
  }
}

TEST(Configuration, TheCommandLineIsBeforeTheEnvironmentAndThatBeforeTheFile) {
  const TemporaryFolder folder;
  const std::string file = folder / "config.toml";
  write_file(file, "workers = 7\nmax-queue = 7\nkeep-days = 7\n");
  const std::vector<std::string> environment = {"ISOMESH_WORKERS=3", "ISOMESH_MAX_QUEUE=3"};
  const Finished told = run({ISOMESHD, "check", "--config", file, "--workers", "1"}, environment);
  EXPECT_EQ(told.status, 0) << told.errors;
  for (const std::string line : {"workers = 1\n", "max-queue = 3\n", "keep-days = 7\n"}) {
    EXPECT_THAT('\n' + told.output, HasSubstr('\n' + line));
  }
}

TEST(Configuration, WhatAStartWouldRefuseIsToldToo) {
  const TemporaryFolder folder;
  const Finished open = run({ISOMESHD, "check", "--listen", "0.0.0.0:0"});
  EXPECT_EQ(open.status, 1);
  EXPECT_THAT(open.errors, HasSubstr("--open-network"));
  const Finished tokens = run({ISOMESHD, "check", "--tokens", folder / "absent"});
  EXPECT_EQ(tokens.status, 1);
}

TEST(Configuration, EachFileThatCannotBeReadIsNamed) {
  const TemporaryFolder folder;
  const auto absent = [&](const std::string& name) {
    return (folder / ("absent-" + name)).string();
  };
  write_file(folder / "hospital.toml",
             "[[pacs]]\nname = \"main\"\ndicomweb = \"https://pacs\"\n"
             "ca-file = \"" +
                 absent("pacs-ca") + "\"\ntoken-file = \"" + absent("token") +
                 "\"\n[audit]\nsyslog = \"tls://collector\"\nca-file = \"" + absent("audit-ca") +
                 "\"\n");
  const std::vector<std::string> command = {ISOMESHD,
                                            "check",
                                            "--data",
                                            folder / "data",
                                            "--hospital",
                                            folder / "hospital.toml",
                                            "--tls-cert",
                                            absent("cert"),
                                            "--tls-key",
                                            absent("key"),
                                            "--callback-ca",
                                            absent("callback"),
                                            "--blob-ca",
                                            absent("blob"),
                                            "--store",
                                            "postgresql://db/x?sslmode=verify-full&sslrootcert=" +
                                                absent("root") + "&sslcert=" + absent("client")};
  const Finished told = run(command, {"PGSSLKEY=" + absent("client-key")});
  EXPECT_EQ(told.status, 1);
  for (const std::string name : {"pacs-ca", "token", "audit-ca", "cert", "key", "callback", "blob",
                                 "root", "client", "client-key"}) {
    EXPECT_THAT(told.errors, HasSubstr(absent(name) + " cannot be read: No such file")) << name;
  }
  EXPECT_THAT(told.errors, HasSubstr("pacs main: ca-file: "));
  EXPECT_THAT(told.errors, HasSubstr("store: sslrootcert: "));
  const Finished folders =
      run({ISOMESHD, "check", "--data", folder / "data", "--callback-ca", "/"});
  EXPECT_THAT(folders.errors, HasSubstr("callback-ca: / cannot be read: Is a directory"));
}

// Without tokens only this machine may ask.
TEST(Start, TheOpenNetworkIsRefusedUnlessAskedFor) {
  const TemporaryFolder folder;
  const Finished result = run({ISOMESHD, "--data", folder / "data", "--listen", "0.0.0.0:0"});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.errors, HasSubstr("--open-network"));
  const Daemon open(folder / "data", "0.0.0.0:0", {"--open-network"});
  EXPECT_EQ(open.get("/livez").status, 200);
}

TEST(Start, ASecondDaemonOnTheSameFolderIsRefused) {
  const Daemon first;
  const Finished second = refused_start(first.data());
  EXPECT_EQ(second.status, 1);
  EXPECT_THAT(second.errors, HasSubstr("another isomeshd"));
  EXPECT_TRUE(second.output.empty());
  EXPECT_EQ(first.get("/livez").status, 200);
}

TEST(Start, ASecondDaemonOnTheSamePortIsRefused) {
  const Daemon first;
  const TemporaryFolder folder;
  const std::string address = first.url().substr(std::string("http://").size());
  const Finished second = run({ISOMESHD, "--data", folder / "data", "--listen", address});
  EXPECT_EQ(second.status, 1);
  EXPECT_FALSE(second.errors.empty());
}

TEST(UnixSocket, IsServedAndRemoved) {
  const TemporaryFolder folder;
  const std::string socket = folder / "http.sock";
  Daemon daemon(folder / "data", "unix:" + socket);
  EXPECT_EQ(daemon.url(), "unix:" + socket);
  struct stat status = {};
  ASSERT_EQ(::stat(socket.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0660U);
  EXPECT_EQ(daemon.get("/livez").status, 200);
  EXPECT_EQ(finished_job(daemon).state, JobState::kSucceeded);
  EXPECT_EQ(daemon.command({"list"}).status, 0);
  EXPECT_EQ(daemon.stop(), 0);
  EXPECT_FALSE(std::filesystem::exists(socket));
}

TEST(UnixSocket, OfAKilledDaemonIsNoObstacle) {
  const TemporaryFolder folder;
  const std::string socket = folder / "http.sock";
  { const Daemon killed(folder / "data", "unix:" + socket); }
  ASSERT_TRUE(std::filesystem::exists(socket));
  const Daemon next(folder / "data", "unix:" + socket);
  EXPECT_EQ(next.get("/livez").status, 200);
}

TEST(Restart, KeepsVolumesAndJobsAndSweepsTheRest) {
  const TemporaryFolder folder;
  Volume volume;
  Job job;
  {
    Daemon daemon(folder / "data", "127.0.0.1:0");
    job = finished_job(daemon);
    volume = daemon.client().volumes().at(0);
    EXPECT_EQ(daemon.stop(), 0);
  }
  write_file(folder / "data/scratch/left-behind", "by a crash");
  const Daemon daemon(folder / "data", "127.0.0.1:0");
  EXPECT_EQ(daemon.client().volumes(), std::vector{volume});
  EXPECT_EQ(blobs_below(folder / "data").size(), 2U);
  EXPECT_TRUE(files_below(folder / "data/scratch").empty());
  EXPECT_EQ(daemon.client().job(job.id), job);
  EXPECT_EQ(daemon.get("/v1/jobs/" + job.id + "/mesh.drc").status, 200);
  const Job next = submit(daemon, volume, 90);
  EXPECT_EQ(daemon.client().wait(next.id).state, JobState::kSucceeded);
}

// A start that waits, here for a database that says nothing.
TEST(Start, SigtermEndsItBeforeItListens) {
  const TemporaryFolder folder;
  const net::Listener silent(net::parse_address("127.0.0.1:0"));
  Process process({ISOMESHD, "--listen", "127.0.0.1:0", "--data", folder / "data", "--store",
                   "postgresql://nobody@" + silent.authority() + "/isomesh"});
  const Descriptor connection(::accept4(silent.descriptor(), nullptr, nullptr, SOCK_CLOEXEC));
  process.send_signal(SIGTERM);
  EXPECT_EQ(process.wait(), 0) << process.errors();
  EXPECT_EQ(process.output(), "");
}

}  // namespace
}  // namespace isomesh
