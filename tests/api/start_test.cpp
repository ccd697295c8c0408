// The needs of a start, what it refuses, and what it tells.
#include <deque>
#include <filesystem>
#include <regex>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "server/net/descriptors.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::Not;

std::vector<std::string> with_descriptors(std::size_t most) {
  return {"/bin/sh", "-c", "ulimit -n " + std::to_string(most) + R"(; exec "$@")", "sh"};
}

TEST(Descriptors, AStartNeedsSome) {
  const TemporaryFolder folder;
  const Finished refused = run(
      with(with_descriptors(32), {ISOMESHD, "--data", folder / "data", "--listen", "127.0.0.1:0"}));
  EXPECT_EQ(refused.status, 1);
  EXPECT_EQ(refused.output, "");
  EXPECT_THAT(refused.errors, HasSubstr("isomeshd: at least 128 file descriptors are needed, "
                                        "and the limit is 32: raise it"));
  EXPECT_FALSE(std::filesystem::exists(folder / "data"));
}

// With the fewest, also while other clients hold all connections that they can.
TEST(Descriptors, TheFewestSufficeForAJob) {
  const TemporaryFolder folder;
  const Daemon daemon(folder / "data", "127.0.0.1:0", {},
                      with_descriptors(net::kFewestDescriptors));
  std::deque<Connection> idle;
  for (std::size_t i = 0; i < net::kFewestDescriptors; ++i)
    idle.emplace_back(daemon.url()).send("GET ");
  const Job job = finished_job(daemon);
  EXPECT_EQ(job.state, JobState::kSucceeded);
  EXPECT_EQ(daemon.get("/v1/jobs/" + job.id + "/mesh.drc").status, 200);
}

TEST(StartOfADaemon, IsInItsLog) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "blobs");
  const Daemon daemon(folder / "data", "127.0.0.1:0",
                      {"--log-format", "json", "--workers", "3", "--blobs", folder / "blobs"});
  ASSERT_TRUE(eventually([&] { return daemon.errors().find('\n') != std::string::npos; }));
  std::istringstream lines(daemon.errors());
  std::string line;
  ASSERT_TRUE(std::getline(lines, line));
  const auto start = nlohmann::json::parse(line);
  EXPECT_EQ(start["event"], "start");
  EXPECT_THAT(daemon.get("/version").body, HasSubstr("\"version\":" + start["version"].dump()));
  EXPECT_EQ(start["url"], daemon.url());
  EXPECT_EQ(start["records"], "sqlite");
  EXPECT_EQ(start["blobs"], "folder");
  EXPECT_EQ(start["workers"], 3);
  EXPECT_EQ(start["tokens"], "no");
  EXPECT_THAT(line, Not(HasSubstr(folder.path().string())));
}

// The example lines of the file that is installed.
TEST(ExampleConfiguration, IsValidWithoutItsCommentSigns) {
  const TemporaryFolder folder;
  const Finished written = run({ISOMESHD, "--data", folder / "data", "config"});
  const std::regex example("# ([a-z-]+( = .*)?)");
  std::istringstream lines(written.output);
  std::string all;
  int count = 0;
  for (std::string line; std::getline(lines, line);) {
    std::smatch parts;
    if (std::regex_match(line, parts, example)) {
      line = parts[1];
      ++count;
      write_file(folder / "one.toml", line + '\n');
      const Finished one = run({ISOMESHD, "--check-config", "--config", folder / "one.toml"});
      EXPECT_EQ(one.status, 0) << line << one.errors;
      EXPECT_EQ(one.errors, "") << line;
    }
    all += line + '\n';
  }
  EXPECT_GT(count, 30);
  write_file(folder / "all.toml", all);
  const Finished checked = run({ISOMESHD, "--check-config", "--config", folder / "all.toml"});
  EXPECT_EQ(checked.status, 0) << checked.errors;
  EXPECT_THAT(checked.output, HasSubstr("\n# tokens = \"\"\n"));
}

TEST(ExampleConfiguration, AnEmptyStringHidesNoDefault) {
  const TemporaryFolder folder;
  for (const std::string line : {"workers = ''", "listen = ''", "log-level = ''",
                                 "open-network = ''", "cors-origin = ['']"}) {
    write_file(folder / "config.toml", line + '\n');
    EXPECT_NE(run({ISOMESHD, "check", "--config", folder / "config.toml"}).status, 0) << line;
  }
}

TEST(FilesOfOptions, AreNamedIfTheyCannotBeRead) {
  const TemporaryFolder folder;
  const std::string absent = folder / "absent";
  for (const std::vector<std::string>& options : std::vector<std::vector<std::string>>{
           {"--tokens", absent},
           {"--callback-secret-file", absent, "--callback-allow", "https://ris.example"},
           {"--callback-ca", absent},
           {"--tls-cert", absent, "--tls-key", absent},
           {"--blobs", "s3://bucket?endpoint=http://127.0.0.1:1", "--blob-credentials", absent},
           {"--blobs", "s3://bucket?endpoint=http://127.0.0.1:1", "--blob-ca", absent},
           {"--hospital", absent},
           {"--config", absent}}) {
    for (const std::vector<std::string>& way :
         std::vector<std::vector<std::string>>{{"check"}, {"--check-config"}, {}}) {
      const Finished refused = refused_start(folder / "data", with(options, way));
      EXPECT_NE(refused.status, 0) << options[0];
      EXPECT_THAT(refused.errors, HasSubstr(absent)) << options[0];
    }
  }
}

TEST(CorsOrigin, ThatMatchesNoPageIsRefusedWithOneThatDoes) {
  const TemporaryFolder folder;
  for (const auto& [wrong, right] :
       {std::pair<std::string, std::string>{"https://viewer.example/", "https://viewer.example"},
        {"https://viewer.example/app", "https://viewer.example"},
        {"viewer.example", "https://viewer.example"},
        {"https://viewer.example:443", "https://viewer.example"},
        {"http://Viewer.example:80/", "http://viewer.example"}}) {
    const Finished refused = refused_start(folder / "data", {"--cors-origin", wrong});
    EXPECT_EQ(refused.status, 2) << wrong;
    EXPECT_THAT(refused.errors,
                HasSubstr(wrong + " matches no page; the origin is " + right + '\n'));
  }
  for (const std::string right :
       {"*", "https://viewer.example", "http://localhost:8080", "https://Viewer.Example",
        "https://a.example,https://b.example"}) {
    EXPECT_EQ(run({ISOMESHD, "check", "--cors-origin", right}).status, 0) << right;
  }
}

TEST(CorsOrigin, ThatIsRefusedIsInTheLogOnce) {
  Daemon daemon({"--log-format", "json", "--cors-origin", "https://viewer.example"});
  const auto get_from = [&](const std::string& origin) {
    return daemon.get("/v1/jobs", {{"Origin", origin}}).status;
  };
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(get_from("https://viewer.exmaple"), 200);
    EXPECT_EQ(get_from("https://viewer.example"), 200);
    EXPECT_EQ(get_from("http://localhost"), 200);
  }
  EXPECT_EQ(daemon.send("POST", "/v1/jobs", "{}", {{"Origin", "null"}}).status, 403);
  EXPECT_EQ(daemon
                .send("OPTIONS", "/v1/jobs", {},
                      {{"Origin", "http://x\" y"}, {"Access-Control-Request-Method", "POST"}})
                .status,
            405);
  for (int i = 0; i < 200; ++i) {
    get_from("https://" + std::to_string(i) + std::string(1000, 'x') + ".example");
  }
  EXPECT_EQ(daemon.stop(), 0);
  std::vector<std::string> refused;
  std::istringstream lines(daemon.errors());
  for (std::string line; std::getline(lines, line);) {
    const auto object = nlohmann::json::parse(line);
    if (object["event"] != "origin_refused") continue;
    EXPECT_EQ(object["level"], "warning");
    EXPECT_THAT(object["reason"], HasSubstr("pages of this origin may not use the service"));
    EXPECT_LT(line.size(), 500U);
    refused.push_back(object["origin"]);
  }
  ASSERT_EQ(refused.size(), 64U);
  EXPECT_EQ(refused[0], "https://viewer.exmaple");
  EXPECT_EQ(refused[1], "null");
  EXPECT_EQ(refused[2], "http://x\" y");
}

}  // namespace
}  // namespace isomesh
