#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/dicom_uid.h"
#include "server/hospital/protocol/orders.h"
#include "tests/support/errors.h"
#include "tests/support/flips.h"

namespace isomesh {
namespace {

using testing::HasSubstr;

Order some_order() {
  Order order;
  order.id = "01";
  order.state = OrderState::kSending;
  order.rule = "bone";
  order.source = {.pacs = "main", .study = "1.2", .series = "1.3", .instances = 54};
  order.parameters.iso = 250;
  order.parameters.formats = {MeshFormat::kStl};
  order.parameters.lambda = 1;
  order.send = {{.pacs = "main"}};
  order.volume = "aa";
  order.job = "02";
  order.results = {{.pacs = "main",
                    .label = 3,
                    .series_uid = "2.25.1",
                    .sop_instance_uid = "2.25.2",
                    .bytes = 5,
                    .stored = true}};
  order.attempts = 2;
  order.next_attempt = "2026-11-21T07:00:00.000Z";
  order.created = "2026-11-21T06:00:00.000Z";
  order.error = to_problem(Error(ErrorCode::kPacsUnreachable, "it is not there"), "/v1/orders/01");
  return order;
}

OrderWork some_work() {
  OrderWork work;
  work.listed = {"1.4", "1.5"};
  work.listed_since = "2026-11-21T06:00:00.000Z";
  work.contents = {"1.4 ab", "1.5 cd"};
  work.failures = 3;
  work.looks = 1;
  work.begun = "2026-11-21T06:00:00.000Z";
  work.identity.emplace().patient_name = "M\xc3\xbcller^Eva";
  work.blobs = {"ab"};
  work.label = "Bone";
  work.series_number = 9001;
  work.callback = "https://ris.example/";
  work.sending = "main 2.25.7";
  return work;
}

TEST(OrderJson, OrdersComeAsTheyWent) {
  EXPECT_EQ(order_from_json(to_json(some_order())), some_order());
  EXPECT_EQ(order_from_record(to_json(some_order())), some_order());
  EXPECT_EQ(orders_from_json(to_json(std::vector{some_order()})), std::vector{some_order()});
  EXPECT_EQ(order_work_from_record(to_record(some_work())), some_work());
  const std::vector<PacsStatus> pacs = {{.name = "main", .reason = "timeout"}};
  EXPECT_EQ(pacs_from_json(to_json(pacs)), pacs);
}

TEST(OrderJson, NamesOtherObjectsByTheirIds) {
  for (const auto member : {&Order::job, &Order::volume, &Order::label_volume}) {
    Order odd = some_order();
    odd.*member = "$(id)";
    EXPECT_EQ(test::code_thrown_by([&] { order_from_json(to_json(odd)); }), ErrorCode::kInternal);
    EXPECT_EQ(orders_from_json(to_json(std::vector{odd, some_order()})), std::vector{some_order()});
  }
}

TEST(OrderJson, RecordsWithAWrongByteAreNoOthers) {
  EXPECT_EQ(order_from_record(to_record(some_order())), some_order());
  test::expect_wrong_bytes_found(to_record(some_order()), order_from_record);
  test::expect_wrong_bytes_found(to_record(some_work()), order_work_from_record);
}

TEST(OrderJson, RecordsOfAnOlderVersionAreRead) {
  EXPECT_EQ(order_work_from_record("{}"), OrderWork());
}

TEST(OrderJson, CallbacksTellNothingOfPatients) {
  Order order = some_order();
  order.error = to_problem(Error(ErrorCode::kUnusableVolume, "slice SECRET is missing"), "");
  const std::string told = to_callback_json(order);
  for (const char* secret : {"1.2", "1.3", "2.25", "SECRET"}) {
    EXPECT_EQ(told.find(secret), std::string::npos) << secret;
  }
  EXPECT_THAT(told, HasSubstr("unusable-volume"));
  EXPECT_THAT(told, HasSubstr("sending"));
}

TEST(OrderStates, NamesAndBack) {
  for (int number = 0; number <= static_cast<int>(OrderState::kCancelled); ++number) {
    const auto state = static_cast<OrderState>(number);
    EXPECT_EQ(from_string<OrderState>(to_string(state)), state);
    EXPECT_EQ(is_final(state), number >= static_cast<int>(OrderState::kSucceeded));
  }
  EXPECT_FALSE(from_string<OrderState>("queued"));
}

TEST(Uids, AreNumbersWithDots) {
  for (const char* uid : {"1", "1.2.840.10008.1", "2.25.329800735698586629295641978511506172918"}) {
    EXPECT_TRUE(is_uid(uid)) << uid;
  }
  for (const char* text : {"", ".1", "1.", "1..2", "1.a", "1/2", "1 2", "../1", "1%2e"}) {
    EXPECT_FALSE(is_uid(text)) << text;
  }
  EXPECT_FALSE(is_uid(std::string(65, '1')));
}

constexpr const char* kWhole = R"({
  "source": {"pacs": "main", "study": "1.2", "series": "1.3"}, "rule": "bone",
  "parameters": {"iso": 60}, "send": [{"pacs": "other", "format": "stl"}],
  "priority": "stat", "callback": {"url": "https://ris.example/"}})";

TEST(OrderRequests, AreRead) {
  const OrderRequest request = parse_order_request(kWhole);
  EXPECT_EQ(request.source, (OrderSource{.pacs = "main", .study = "1.2", .series = "1.3"}));
  EXPECT_EQ(request.rule, "bone");
  EXPECT_EQ(request.send, (std::vector<SendTarget>{{.pacs = "other"}}));
  EXPECT_EQ(request.priority, Priority::kStat);
  EXPECT_EQ(request.callback->url, "https://ris.example/");
  EXPECT_EQ(parse_order_parameters("", *request.parameters, "").iso, 60);
  EXPECT_EQ(parse_order_request(to_json(request)).source, request.source);
}

TEST(OrderRequests, NameWhatIsWrong) {
  const auto fault_of = [](const std::string& body) {
    const auto error = test::thrown_by([&] { parse_order_request(body); });
    if (!error) return std::string("nothing");
    return error->fields().empty() ? std::string(error->what()) : error->fields().front().field;
  };
  const std::string source = R"("source": {"pacs": "main", "study": "1.2", "series": "1.3"})";
  EXPECT_THAT(fault_of(""), HasSubstr("JSON object"));
  EXPECT_THAT(fault_of("[]"), HasSubstr("JSON object"));
  EXPECT_EQ(fault_of("{}"), "source");
  EXPECT_EQ(fault_of(R"({"source": {"pacs": "main", "study": "1.2"}, "rule": "b"})"),
            "source.series");
  EXPECT_EQ(
      fault_of(R"({"source": {"pacs": "m", "study": "http://x", "series": "1"}, "rule": "b"})"),
      "source.study");
  EXPECT_EQ(fault_of(R"({"source": {"pacs": "m", "study": "1", "series": "1", "url": "x"},
                         "rule": "b"})"),
            "source.url");
  EXPECT_EQ(fault_of(R"({"source": {"pacs": "m", "study": "1", "series": "1", "instances": 7},
                         "rule": "b"})"),
            "source.instances");
  EXPECT_EQ(fault_of(R"({"source": "x", "rule": "b"})"), "source");
  EXPECT_EQ(fault_of(R"({"source": {"pacs": 7, "study": "1", "series": ""}, "rule": "b"})"),
            "source.pacs");
  EXPECT_EQ(fault_of(R"({"source": {"pacs": "m", "study": "1", "series": ""}, "rule": "b"})"),
            "source.series");
  EXPECT_EQ(fault_of('{' + source + R"(, "rule": "b", "rule": "c"})"), "rule");
  EXPECT_EQ(fault_of('{' + source + R"(, "rule": null})"), "rule");
  EXPECT_EQ(fault_of('{' + source + R"(, "rule": "b", "parameters": []})"), "parameters");
  EXPECT_EQ(fault_of('{' + source + R"(, "rule": "b", "send": {}})"), "send");
  EXPECT_EQ(fault_of('{' + source + R"(, "rule": "b", "send": ["x"]})"), "send");
  EXPECT_EQ(fault_of('{' + source + R"(, "rule": "b", "send": [{"format": "stl"}]})"), "send.pacs");
  EXPECT_EQ(fault_of('{' + source + R"(, "rule": "b", "callback": {}})"), "callback.url");
  EXPECT_EQ(fault_of('{' + source + "}"), "parameters");
  EXPECT_EQ(fault_of('{' + source + R"(, "parameters": {"iso": 1}})"), "send");
  EXPECT_EQ(fault_of('{' + source + R"(, "rule": "b", "priority": "soon"})"), "priority");
  EXPECT_EQ(fault_of('{' + source + R"(, "rule": "b", "callback": "x"})"), "callback");
  EXPECT_EQ(fault_of('{' + source + R"(, "rule": "b", "send": [{"pacs": "m", "format": "drc"}]})"),
            "send.format");
  EXPECT_EQ(fault_of('{' + source + R"(, "rule": "b", "pacs": "m"})"), "pacs");
}

TEST(OrderParameters, AreTheRulesUnlessTheOrderSaysOtherwise) {
  const MeshParameters both =
      parse_order_parameters(R"({"iso": 250, "passes": 3})", R"({"passes": 9})", "");
  EXPECT_EQ(both.iso, 250);
  EXPECT_EQ(both.passes, 9);
  EXPECT_EQ(both.formats, std::vector{MeshFormat::kStl});
  EXPECT_TRUE(parse_order_parameters(R"({"iso": 250})", R"({"labels": "all"})", "").labels);
  EXPECT_FALSE(parse_order_parameters(R"({"labels": "all"})", R"({"iso": 1})", "").labels);
}

TEST(OrderParameters, NameWhatIsWrongByItsPlace) {
  const Error error =
      test::error_of([] { parse_order_parameters("", R"({"iso": "x"})", "rules[0].parameters."); });
  EXPECT_EQ(error.fields().front().field, "rules[0].parameters.iso");
  for (const char* own : {R"({"volume": "x", "iso": 1})", R"({"callback": {}, "iso": 1})",
                          R"({"space": "ras", "iso": 1})"}) {
    EXPECT_EQ(test::code_thrown_by([&] { parse_order_parameters("", own, ""); }),
              ErrorCode::kInvalidParameter)
        << own;
  }
}

}  // namespace
}  // namespace isomesh
