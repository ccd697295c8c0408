#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/http/requests/request.h"

namespace isomesh::http {
namespace {

using testing::MatchesRegex;

const std::string kTrace = "4bf92f3577b34da6a3ce929d0e0e4736";
const std::string kParent = "00f067aa0ba902b7";

TEST(Trace, GoesOnUnderItsNameWithASpanOfItsOwn) {
  const Trace trace = continue_trace("00-" + kTrace + '-' + kParent + "-01");
  EXPECT_EQ(trace.trace_id, kTrace);
  EXPECT_NE(trace.span_id, kParent);
  EXPECT_THAT(trace.span_id, MatchesRegex("[0-9a-f]{16}"));
  EXPECT_EQ(trace.request_id(), kTrace + '-' + trace.span_id);
  EXPECT_EQ(continue_trace("cc-" + kTrace + '-' + kParent + "-01-later").trace_id, kTrace);
}

TEST(Trace, IsNewWhereTheHeaderIsNone) {
  for (const std::string& header :
       {std::string(), "00-" + kTrace + '-' + kParent, "00-" + kTrace + '-' + kParent + "-01-more",
        "ff-" + kTrace + '-' + kParent + "-01",
        "00-" + std::string(32, '0') + '-' + kParent + "-01",
        "00-" + kTrace + '-' + std::string(16, '0') + "-01",
        "00-4BF92F3577B34DA6A3CE929D0E0E4736-" + kParent + "-01",
        "00_" + kTrace + '-' + kParent + "-01", "00-" + kTrace + '-' + kParent + "-0\n",
        std::string(55, 'z')}) {
    const Trace trace = continue_trace(header);
    EXPECT_THAT(trace.trace_id, MatchesRegex("[0-9a-f]{32}")) << header;
    EXPECT_NE(trace.trace_id, kTrace) << header;
  }
  EXPECT_NE(continue_trace("").trace_id, continue_trace("").trace_id);
}

}  // namespace
}  // namespace isomesh::http
