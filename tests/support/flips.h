// Records with one wrong byte.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include "base/error.h"

namespace isomesh::test {

// Reads the record with each bit of it wrong in turn: it is the same value, or kInternal.
template <class Read>
void expect_wrong_bytes_found(const std::string& record, const Read& read) {
  const auto whole = read(record);
  std::size_t unnoticed = 0;
  for (std::size_t at = 0; at < record.size(); ++at) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string flipped = record;
      flipped[at] = static_cast<char>(flipped[at] ^ (1 << bit));
      try {
        ASSERT_TRUE(read(flipped) == whole) << flipped;
        ++unnoticed;
      } catch (const Error& error) {
        ASSERT_EQ(error.code(), ErrorCode::kInternal) << flipped;
      }
    }
  }
  constexpr std::size_t kBitsOfItsName = 8 * std::string_view("digest").size();
  EXPECT_LE(unnoticed, kBitsOfItsName);
}

}  // namespace isomesh::test
