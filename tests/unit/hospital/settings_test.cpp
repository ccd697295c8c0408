#include "server/hospital/orders/settings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/hospital/orders/pattern.h"
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

TEST(HospitalSettings, IsRead) {
  using std::chrono::seconds;
  const HospitalSettings hospital = parse_settings(kWhole);
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
  const auto error = test::thrown_by([&] { parse_settings(toml); });
  if (!error) return "nothing";
  EXPECT_EQ(error->code(), ErrorCode::kInvalidParameter);
  return error->what();
}

std::string with(const std::string& from, const std::string& to) {
  std::string text = kWhole;
  return text.replace(text.find(from), from.size(), to);
}

const std::string kSend = "send-by = \"c-store\"\naet = \"A\"\nhost = \"h\"\nport = 104\n";
const std::string kReceive = std::string(kWhole) +
                             "[dimse]\nlisten = \"h:1\"\ncalling = [\"A\"]\n"
                             "routes = { B = \"bone\" }\n";
const std::string kSecure = "certificate-file = \"c\"\nkey-file = \"k\"\nca-file = \"a\"\n";

TEST(HospitalSettings, NamesWhatIsWrong) {
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
      {with("settle-seconds = 7", "settle-seconds = 604801"), "orders.settle-seconds"},
      {with("poll-seconds = 8", "poll-seconds = 604801"), "orders.poll-seconds"},
      {with("https://pacs", "ftp://pacs"), "pacs[0].dicomweb"},
      {with("user = \"isomesh\"", ""), "password-file"},
      {with("\"stow\"", "\"fax\""), "pacs[0].send-by"},
      {with("500_000_000", "5_000_000_000"), "pacs[0].max-send-bytes"},
      {with("watch = \"main\"", "watch = \"other\""), "\"other\", which is not configured"},
      {with("{ pacs = \"main\"", "{ pacs = \"other\""), "\"other\", which is not configured"},
      {with("name = \"bone\"", "name = \"a b\""), "rules[0].name"},
      {with("send-by = \"stow\"", "send-by = \"c-store\"\nhost = \"h\"\nport = 104"),
       "pacs[0].aet: is required"},
      {with("send-by = \"stow\"", "send-by = \"c-store\"\naet = \"A\"\nport = 104"),
       "pacs[0].host: is required"},
      {with("send-by = \"stow\"", "send-by = \"c-store\"\naet = \"A\"\nhost = \"h\""),
       "pacs[0].port: is required"},
      {with("send-by = \"stow\"", "aet = \"A\""), "pacs[0].send-by"},
      {with("send-by = \"stow\"",
            "send-by = \"c-store\"\naet = \"12345678901234567\"\nhost = \"h\"\nport = 104"),
       "pacs[0].aet: must be 1 to 16"},
      {with("dicomweb = \"https://pacs.example.org/dicom-web/\"", ""), "pacs[0].dicomweb"},
      {with("send-by = \"stow\"", "tls = true"), "pacs[0].tls: is for send-by"},
      {with("send-by = \"stow\"", "tls = \"yes\""), "pacs[0].tls: must be true or false"},
      {with("send-by = \"stow\"", kSend + "certificate-name = \"x\""),
       "pacs[0].tls: must be true if"},
      {std::string(kWhole) + "[[pacs]]\nname = \"b\"\n" + kSend +
           "tls = true\ncertificate-name = \"*\"\n",
       "pacs[1].certificate-name: \"*\" needs ca-file"},
      {with("send-by = \"stow\"", kSend + "tls = true\nkey-file = \"k\""),
       "pacs[0].certificate-file: must be given together"},
      {std::string(kWhole) + "max-error-mm = 0\n", "rules[0].max-error-mm"},
      {std::string(kWhole) + "worklist = \"main\"\n", "rules[0].procedures"},
      {std::string(kWhole) + "worklist = \"main\"\nprocedures = [\"MESH\"]\n",
       "rules[0].procedures"},
      {std::string(kWhole) + "procedures = [\"MESH^X\"]\n", "rules[0].worklist"},
      {std::string(kWhole) + "worklist = \"x\"\nprocedures = [\"MESH^X\"]\n",
       "\"x\", which is not configured"},
      {std::string(kWhole) + "[audit]\nsyslog = \"udp://h\"\n", "audit.syslog"},
      {std::string(kWhole) + "[audit]\nsyslog = \"tls://h:0\"\n", "audit.syslog"},
      {std::string(kWhole) + "[audit]\nsyslog = \"tls://:6514\"\n", "audit.syslog"},
      {std::string(kWhole) + "[audit]\nsyslog = \"tls://[::1\"\n", "audit.syslog"},
      {std::string(kWhole) + "[audit]\nsyslog = \"tls://[::1]6514\"\n", "audit.syslog"},
      {std::string(kWhole) + "[audit]\nsyslog = \"tls://h\"\nkey-file = \"k\"\n", "key-file"},
      {std::string(kWhole) + "[dimse]\ncalling = [\"A\"]\nroutes = { B = \"bone\" }\n",
       "dimse.listen: is required"},
      {std::string(kWhole) + "[dimse]\nlisten = \"h:1\"\nroutes = { B = \"bone\" }\n",
       "dimse.calling: is required"},
      {std::string(kWhole) + "[dimse]\nlisten = \"h:1\"\ncalling = [\"A\"]\n",
       "dimse.routes: is required"},
      {std::string(kWhole) +
           "[dimse]\nlisten = \"h:1\"\ncalling = [\"A\"]\nroutes = { B = \"other\" }\n",
       "dimse.routes.B: names the rule \"other\""},
      {kReceive + "key-file = \"k\"\n", "dimse.certificate-file: must be given together"},
      {kReceive + "ca-file = \"k\"\n", "dimse.ca-file: is for TLS"},
      {kReceive + "certificate-names = { A = \"a\" }\n", "dimse.certificate-names: needs ca-file"},
      {kReceive + kSecure + "certificate-names = { C = \"c\" }\n",
       "dimse.certificate-names.C: is not a title in calling"},
      {kReceive + kSecure + "certificate-names = { A = \"\" }\n",
       "dimse.certificate-names.A: is required"},
      {std::string(kWhole) + "[[pacs]]\nname = \"main\"\ndicomweb = \"http://x\"\n", "twice"},
  };
  for (const auto& [toml, name] : wrong) EXPECT_THAT(refusal_of(toml), HasSubstr(name)) << toml;
}

TEST(HospitalSettings, KnowsDimse) {
  const HospitalSettings hospital = parse_settings(R"(
[[pacs]]
name = "archive"
send-by = "c-store"
aet = "ARCHIVE"
calling-aet = "MESHES"
host = "archive.example.org"
port = 11112
tls = true
ca-file = "pacs.pem"
certificate-name = "*"
certificate-file = "client.pem"
key-file = "client.key"
[[rules]]
name = "bone"
max-error-mm = 0.3
parameters = { iso = 250 }
send = [ { pacs = "archive" } ]
[dimse]
listen = "127.0.0.1:11112"
associations = 3
routes = { BONE = "bone", "CT 2" = "bone" }
calling = ["CT1", "ROUTER"]
idle-seconds = 7
max-object-bytes = 8
max-held-bytes = 9
certificate-file = "server.pem"
key-file = "server.key"
ca-file = "peers.pem"
certificate-names = { CT1 = "ct1.example.org" }
[audit]
syslog = "tls://collector.example.org:16514"
ca-file = "/etc/isomesh/ca.pem"
certificate-file = "/etc/isomesh/cert.pem"
key-file = "/etc/isomesh/key.pem"
)");
  const PacsSettings& pacs = hospital.pacs.front();
  EXPECT_EQ(pacs.send_by, SendBy::kCStore);
  EXPECT_EQ(pacs.aet, "ARCHIVE");
  EXPECT_EQ(pacs.calling_aet, "MESHES");
  EXPECT_EQ(pacs.host, "archive.example.org");
  EXPECT_EQ(pacs.port, 11112);
  EXPECT_EQ(pacs.dicomweb, "");
  EXPECT_TRUE(pacs.tls);
  EXPECT_EQ(pacs.ca_file, "pacs.pem");
  EXPECT_EQ(pacs.certificate_name, "*");
  EXPECT_EQ(pacs.certificate_file, "client.pem");
  EXPECT_EQ(pacs.key_file, "client.key");
  EXPECT_EQ(hospital.rules.front().max_error_mm, 0.3);
  ASSERT_TRUE(hospital.dimse);
  EXPECT_EQ(hospital.dimse->listen, "127.0.0.1:11112");
  EXPECT_EQ(hospital.dimse->associations, 3U);
  EXPECT_EQ(hospital.dimse->routes,
            (std::map<std::string, std::string>{{"BONE", "bone"}, {"CT 2", "bone"}}));
  EXPECT_EQ(hospital.dimse->calling, (std::vector<std::string>{"CT1", "ROUTER"}));
  EXPECT_EQ(hospital.dimse->idle, std::chrono::seconds(7));
  EXPECT_EQ(hospital.dimse->max_object_bytes, 8U);
  EXPECT_EQ(hospital.dimse->max_held_bytes, 9U);
  EXPECT_EQ(hospital.dimse->certificate_file, "server.pem");
  EXPECT_EQ(hospital.dimse->key_file, "server.key");
  EXPECT_EQ(hospital.dimse->ca_file, "peers.pem");
  EXPECT_EQ(hospital.dimse->certificate_names,
            (std::map<std::string, std::string>{{"CT1", "ct1.example.org"}}));
  ASSERT_TRUE(hospital.syslog);
  EXPECT_EQ(hospital.syslog->host, "collector.example.org");
  EXPECT_EQ(hospital.syslog->port, 16514);
  EXPECT_EQ(hospital.syslog->ca_file, "/etc/isomesh/ca.pem");
  EXPECT_EQ(hospital.syslog->certificate_file, "/etc/isomesh/cert.pem");
  EXPECT_EQ(hospital.syslog->key_file, "/etc/isomesh/key.pem");
}

// The brackets of a URL are no part of the address to connect to.
TEST(HospitalSettings, HaveTheAddressOfACollector) {
  for (const auto& [url, host, port] : {std::tuple("collector", "collector", 6514),
                                        {"10.0.0.5:7000", "10.0.0.5", 7000},
                                        {"[fd00::5]", "fd00::5", 6514},
                                        {"[fd00::5]:7000", "fd00::5", 7000}}) {
    const HospitalSettings hospital =
        parse_settings(std::string(kWhole) + "[audit]\nsyslog = \"tls://" + url + "\"\n");
    EXPECT_EQ(hospital.syslog->host, host) << url;
    EXPECT_EQ(hospital.syslog->port, port) << url;
  }
}

// Secrets stand in files of their own, but who writes one into this is not to see it in a log.
TEST(HospitalSettings, RefusalsDoNotRepeatValues) {
  const std::string said = refusal_of(with("timeout-seconds = 11", "password = \"hunter2\""));
  EXPECT_THAT(said, HasSubstr("pacs[0].password"));
  EXPECT_THAT(said, testing::Not(HasSubstr("hunter2")));
}

TEST(Matches, StarsAndQuestionMarks) {
  EXPECT_TRUE(matches("*bone*", "Head BONE 1mm"));
  EXPECT_TRUE(matches("head ?mm", "Head 1mm"));
  EXPECT_TRUE(matches("M?rz*", "M\u00e4rz 2026"));
  EXPECT_FALSE(matches("M??rz", "M\u00e4rz"));
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
