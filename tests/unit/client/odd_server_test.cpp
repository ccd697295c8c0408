// Nothing that a server answers is run by a shell, taken for an option, or obeyed by a terminal.
#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/cli/commands.h"
#include "client/cli/console.h"
#include "client/cli/report.h"
#include "client/cli/text.h"
#include "proto/json.h"
#include "server/hospital/client/orders.h"
#include "server/hospital/command/orders.h"
#include "server/hospital/protocol/orders.h"
#include "tests/unit/client/support.h"

namespace isomesh::cli {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

const std::vector<std::string>& odd_words() {
  static const std::vector<std::string> words = {"$(touch ran)",
                                                 "`touch ran`",
                                                 "a;touch ran",
                                                 "a b",
                                                 "-o",
                                                 "--server=http://x",
                                                 "~root",
                                                 "*",
                                                 "../a",
                                                 "a\nb",
                                                 "a\t",
                                                 "a\x1b[2J",
                                                 "\u009b2J",
                                                 "",
                                                 "A_b",
                                                 "b/c",
                                                 ".",
                                                 std::string(65, 'a')};
  return words;
}

std::string output_of(const Options& options) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  run(options, {});
  testing::internal::GetCapturedStderr();
  return testing::internal::GetCapturedStdout();
}

// The words that the script of bash offers for `word`, and whatever it wrote beside them.
std::string offered_by_bash(const test::TemporaryFolder& folder, const std::string& word) {
  const std::string script = R"(
cd "$1"; PATH="$1:$PATH"; . ./script; COMP_WORDS=(isomesh status "$2"); COMP_CWORD=2
_isomesh; printf '<%s>' "${COMPREPLY[@]}")";
  const test::Finished bash =
      test::run({"bash", "-c", script, "bash", folder.path().string(), word});
  return bash.output + bash.errors;
}

TEST(Completion, OfBashComparesWordsAndExpandsNone) {
  const test::TemporaryFolder folder;
  test::write_file(folder / "script", test::end_of({"completion", "bash"}).second);
  test::write_file(folder / "isomesh",
                   "#!/bin/sh\ncat <<'END'\nabc$(touch ran)\t$(touch ran)\nabc`touch ran`\tx\n"
                   "a *\t\n~root\t\n$HOME\t\nEND\n");
  std::filesystem::permissions(folder / "isomesh", std::filesystem::perms::owner_all);
  EXPECT_EQ(offered_by_bash(folder, "a"), "<abc$(touch ran)><abc`touch ran`><a *>");
  EXPECT_EQ(offered_by_bash(folder, ""), "<abc$(touch ran)><abc`touch ran`><a *><~root><$HOME>");
  EXPECT_EQ(offered_by_bash(folder, "*"), "<>");
  EXPECT_EQ(offered_by_bash(folder, "x"), "<>");
  EXPECT_FALSE(std::filesystem::exists(folder / "ran"));
  test::write_file(folder / "isomesh", "#!/bin/sh\necho :files\n");
  test::write_file(folder / "x y$(touch ran).nii", "");
  EXPECT_EQ(offered_by_bash(folder, "x"), "<x y$(touch ran).nii>");
  EXPECT_FALSE(std::filesystem::exists(folder / "ran"));
}

class OddServer : public testing::Test {
 protected:
  Options asked(const std::vector<std::string>& words) {
    Options options = test::options_from(words);
    options.server = server_url_.empty() ? server_url_ = server_.start() : server_url_;
    return options;
  }

  std::string output(const std::vector<std::string>& words) { return output_of(asked(words)); }

  // The errors in place of an output.
  std::string complaint(const std::vector<std::string>& words) {
    const Options options = asked(words);
    testing::internal::CaptureStderr();
    run(options, {});
    return testing::internal::GetCapturedStderr();
  }

  test::FakeServer server_;
  std::string server_url_;
};

TEST_F(OddServer, CompletesNoIdThatIsNone) {
  std::vector<Volume> volumes;
  std::vector<Job> jobs;
  std::vector<Order> orders;
  for (std::string id : odd_words()) {
    for (const std::string& each : {id, "good-" + std::to_string(jobs.size())}) {
      volumes.emplace_back().id = each;
      jobs.push_back(test::finished_job(each, "mesh"));
      orders.emplace_back().id = each;
    }
  }
  server_.http.Get("/v1/volumes", test::answering(to_json(volumes)));
  server_.http.Get("/v1/jobs", test::answering(to_json(jobs)));
  server_.http.Get("/v1/orders", test::answering(to_json(orders)));
  std::string good;
  for (std::size_t n = 0; n < odd_words().size(); ++n)
    good += "good-" + std::to_string(2 * n) + '\n';
  for (const std::string command : {"status", "info", "orders"}) {
    EXPECT_EQ(output({"complete", command, ""}), good) << command;
  }
}

TEST_F(OddServer, DoesNotKeepAShellWaiting) {
  server_.http.Get("/v1/jobs", [](const auto&, auto& response) {
    response.set_chunked_content_provider("application/json", [](std::size_t, auto& sink) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      return sink.write(" ", 1);
    });
  });
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_EQ(output({"complete", "status", ""}), "");
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(60));
}

TEST_F(OddServer, GivesPagesWithoutEnd) {
  const auto page = test::answering(R"({"jobs": [], "orders": [], "next": "more"})");
  server_.http.Get("/v1/jobs", page);
  server_.http.Get("/v1/orders", page);
  EXPECT_THAT(complaint({"status", "abcd"}), HasSubstr("there is no job whose id"));
  EXPECT_THAT(complaint({"orders", "abcd"}), HasSubstr("there is no order whose id"));
}

// `isomesh submit $(isomesh upload FILE)`, and the name of a file.
TEST_F(OddServer, AnObjectWithAnIdThatIsNoneFails) {
  std::string body;
  const auto answer = [&](const auto&, auto& response) {
    response.set_content(body, "application/json");
  };
  server_.http.Get("/v1/jobs/7", answer);
  server_.http.Get("/v1/volumes/7", answer);
  server_.http.Get("/v1/orders/7", answer);
  Client client({.server = server_.start()});
  for (const std::string& word : odd_words()) {
    body = to_json(test::finished_job(word, "mesh"));
    EXPECT_THAT(test::error_of([&] { client.job("7"); }).what(),
                HasSubstr("the server's response has an id"))
        << word;
    Volume volume = test::some_volume();
    volume.id = word;
    body = to_json(volume);
    EXPECT_EQ(test::error_of([&] { client.volume("7"); }).code(), ErrorCode::kInternal) << word;
    Order order;
    order.id = word;
    body = to_json(order);
    EXPECT_EQ(test::error_of([&] { OrderClient(client).get("7"); }).code(), ErrorCode::kInternal);
  }
}

TEST_F(OddServer, ControlsNoTerminal) {
  const std::string evil = "e\x1b]0;x\a\x7f\u009b2J";
  Order order;
  order.id = "8";
  order.created = evil;
  order.next_attempt = evil;
  order.source.pacs = evil + "\n";
  order.source.study = evil;
  OrderResult& stored = order.results.emplace_back();
  stored.pacs = stored.sop_instance_uid = evil;
  stored.stored = true;
  Volume volume = test::some_volume();
  volume.name = volume.format = volume.created = evil;
  Job job = test::finished_job("7", "mesh");
  job.created = evil;
  job.error.emplace().detail = evil;
  const PacsStatus pacs{
      .name = evil + "\n", .last_success = evil, .last_failure = evil, .reason = evil};
  server_.http.Get("/v1/orders", test::answering(to_json(std::vector{order})));
  server_.http.Get("/v1/pacs", test::answering(to_json(std::vector{pacs})));
  server_.http.Get("/v1/jobs", test::answering(to_json(std::vector{job})));
  server_.http.Get("/v1/jobs/7", test::answering(to_json(job)));
  server_.http.Get("/v1/jobs/7/report",
                   test::answering("{\"a\": \"" + std::string("\u009b") + "\"}"));
  server_.http.Get("/v1/volumes", test::answering(to_json(std::vector{volume})));
  const std::vector<std::vector<std::string>> commands = {
      {"orders"}, {"pacs"}, {"list"}, {"list", "--volumes"}, {"status", "7"}, {"report", "7"}};
  for (const std::vector<std::string>& words : commands) {
    for (const bool json : {false, true}) {
      std::vector<std::string> all = words;
      if (json) all.push_back("--json");
      const std::string text = output(all);
      EXPECT_FALSE(text.empty()) << words.front();
      EXPECT_EQ(text.find_first_of("\x1b\a\x7f"), std::string::npos) << text;
      EXPECT_EQ(text.find("\u009b"), std::string::npos) << text;
    }
  }
  EXPECT_EQ(output({"report", "7"}), "{\"a\": \"\\u009b\"}\n");
  EXPECT_EQ(output({"pacs"}),
            "e\uFFFD]0;x\uFFFD\uFFFD\uFFFD2J\uFFFD  last success e\uFFFD]0;x\uFFFD\uFFFD\uFFFD2J"
            "  last failure e\uFFFD]0;x\uFFFD\uFFFD\uFFFD2J (e\uFFFD]0;x\uFFFD\uFFFD\uFFFD2J)\n");
  EXPECT_EQ(jobs_from_json(output({"list", "--json"})), std::vector{job});
}

// A person copies these words.
TEST_F(OddServer, WordsForAShellAreQuoted) {
  EXPECT_EQ(shell_word("a/b-c_1.nii"), "a/b-c_1.nii");
  EXPECT_EQ(shell_word("it's $(touch ran)"), "'it'\\''s $(touch ran)'");
  EXPECT_EQ(shell_word("a\x1b"), "'a\uFFFD'");
  EXPECT_EQ(shell_word(""), "''");
  EXPECT_THAT(remedy_report({.choices = {{"member", "a`touch ran`.nii", "title"}}}),
              HasSubstr("--member 'a`touch ran`.nii'  # title\n"));
  EXPECT_THAT(remedy_report({.choices = {{"member;touch ran", "a", "title; touch ran"}}}),
              HasSubstr("'--member;touch ran' a  # title; touch ran\n"));
  testing::internal::CaptureStderr();
  tell_next("isomesh list", "a;b");
  tell_next("isomesh list", "");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "More: isomesh list --cursor 'a;b'\n");
}

}  // namespace
}  // namespace isomesh::cli
