#include "server/orders/hospital.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/errors.h"

namespace isomesh::orders {
namespace {

using testing::HasSubstr;

constexpr const char* kWhole = R"(
[orders]
settle-seconds = 7
poll-seconds = 8
first-delay-seconds = 9
give-up-hours = 10
station-name = "here"

[[pacs]]
name = "main"
dicomweb = "https://pacs.example.org/dicom-web/"
user = "isomesh"
password-file = "/etc/isomesh/pacs"
ca-file = "/etc/isomesh/ca.pem"
timeout-seconds = 11
transfer-syntax = "1.2.840.10008.1.2.1"
send-by = "stow"
max-send-bytes = 500_000_000
owners = ["radiology"]

[[rules]]
name = "bone"
owner = "radiology"
label = "Bone"
series-number = 12
watch = "main"
match = { modality = "CT", series-description = "*bone*", min-instances = 20, days = 3 }
parameters = { iso = 250, scheme = 6, passes = 5, close = true, components = { keep = 1 } }
send = [ { pacs = "main", format = "stl" } ]
)";

TEST(Hospital, IsRead) {
  using std::chrono::seconds;
  const Hospital hospital = parse_hospital(kWhole);
  EXPECT_EQ(hospital.settle, seconds(7));
  EXPECT_EQ(hospital.poll, seconds(8));
  EXPECT_EQ(hospital.first_delay, seconds(9));
  EXPECT_EQ(hospital.give_up, std::chrono::hours(10));
  EXPECT_EQ(hospital.station_name, "here");
  ASSERT_EQ(hospital.pacs.size(), 1U);
  const PacsSettings& pacs = hospital.pacs.front();
  EXPECT_EQ(pacs.dicomweb, "https://pacs.example.org/dicom-web");
  EXPECT_EQ(pacs.user, "isomesh");
  EXPECT_EQ(pacs.password_file, "/etc/isomesh/pacs");
  EXPECT_EQ(pacs.ca_file, "/etc/isomesh/ca.pem");
  EXPECT_EQ(pacs.timeout, seconds(11));
  EXPECT_EQ(pacs.max_send_bytes, 500'000'000U);
  EXPECT_EQ(pacs.owners, std::vector<std::string>{"radiology"});
  ASSERT_EQ(hospital.rules.size(), 1U);
  const Rule& rule = hospital.rules.front();
  EXPECT_EQ(rule.owner, "radiology");
  EXPECT_EQ(rule.label, "Bone");
  EXPECT_EQ(rule.series_number, 12);
  EXPECT_EQ(rule.watch, "main");
  EXPECT_EQ(rule.match.min_instances, 20U);
  EXPECT_EQ(rule.match.days, 3U);
  const MeshParameters parameters = parse_order_parameters(rule.parameters, "", "");
  EXPECT_EQ(parameters.iso, 250);
  EXPECT_TRUE(parameters.close);
  EXPECT_EQ(parameters.components.keep, 1U);
  EXPECT_EQ(rule.send, std::vector<SendTarget>{{.pacs = "main"}});
}

std::string refusal_of(const std::string& toml) {
  const auto error = test::thrown_by([&] { parse_hospital(toml); });
  if (!error) return "nothing";
  EXPECT_EQ(error->code(), ErrorCode::kInvalidParameter);
  return error->what();
}

std::string with(const std::string& from, const std::string& to) {
  std::string text = kWhole;
  return text.replace(text.find(from), from.size(), to);
}

TEST(Hospital, NamesWhatIsWrong) {
  const std::vector<std::pair<std::string, std::string>> wrong = {
      {"", "pacs"},
      {"x", "line 1"},
      {with("poll-seconds", "pol-seconds"), "orders.pol-seconds: is not a known key"},
      {with("[orders]", "[order]"), "order: is not a known key"},
      {with("transfer-syntax", "transfer_syntax"), "pacs[0].transfer_syntax"},
      {with("days = 3", "day = 3"), "rules[0].match.day"},
      {with("format = \"stl\" }", "format = \"stl\", x = 1 }"), "rules[0].send[0].x"},
      {with("passes = 5", "passe = 5"), "rules[0].parameters.passe"},
      {with("iso = 250", "iso = \"much\""), "rules[0].parameters.iso"},
      {with("settle-seconds = 7", "settle-seconds = \"7\""), "orders.settle-seconds"},
      {with("settle-seconds = 7", "settle-seconds = -1"), "orders.settle-seconds"},
      {with("https://pacs", "ftp://pacs"), "pacs[0].dicomweb"},
      {with("user = \"isomesh\"", ""), "password-file"},
      {with("\"stow\"", "\"fax\""), "pacs[0].send-by"},
      {with("500_000_000", "5_000_000_000"), "pacs[0].max-send-bytes"},
      {with("watch = \"main\"", "watch = \"other\""), "\"other\", which is not configured"},
      {with("{ pacs = \"main\"", "{ pacs = \"other\""), "\"other\", which is not configured"},
      {with("name = \"bone\"", "name = \"a b\""), "rules[0].name"},
      {std::string(kWhole) + "[[pacs]]\nname = \"main\"\ndicomweb = \"http://x\"\n", "twice"},
  };
  for (const auto& [toml, name] : wrong) EXPECT_THAT(refusal_of(toml), HasSubstr(name)) << toml;
}

// Secrets stand in files of their own, but who writes one into this is not to see it in a log.
TEST(Hospital, RefusalsDoNotRepeatValues) {
  const std::string said = refusal_of(with("timeout-seconds = 11", "password = \"hunter2\""));
  EXPECT_THAT(said, HasSubstr("pacs[0].password"));
  EXPECT_THAT(said, testing::Not(HasSubstr("hunter2")));
}

TEST(Matches, StarsAndQuestionMarks) {
  EXPECT_TRUE(matches("*bone*", "Head BONE 1mm"));
  EXPECT_TRUE(matches("head ?mm", "Head 1mm"));
  EXPECT_TRUE(matches("*", ""));
  EXPECT_TRUE(matches("a*b*c", "aXbYbZc"));
  EXPECT_FALSE(matches("bone", "Head bone"));
  EXPECT_FALSE(matches("a*b", "abc"));
  EXPECT_FALSE(matches("?", ""));
  // Linear for each star, however often the text nearly matches.
  EXPECT_FALSE(matches("*a*a*a*a*a*a*a*a*b", std::string(20'000, 'a')));
}

}  // namespace
}  // namespace isomesh::orders
