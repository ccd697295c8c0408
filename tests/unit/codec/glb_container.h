// A GLB file taken apart by what glTF's specification says of it.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace isomesh::test {

inline std::uint32_t word_at(const std::string& bytes, std::size_t offset) {
  std::uint32_t word = 0;
  std::memcpy(&word, bytes.data() + offset, sizeof word);
  return word;
}

// The two chunks of a GLB file; fails where the container is not as specified.
struct GlbContainer {
  nlohmann::json document;
  std::string binary;
};

inline GlbContainer open_container(const std::string& glb) {
  EXPECT_EQ(glb.substr(0, 4), "glTF");
  EXPECT_EQ(word_at(glb, 4), 2U);
  EXPECT_EQ(word_at(glb, 8), glb.size());
  EXPECT_EQ(glb.size() % 4, 0U);
  const std::uint32_t json_bytes = word_at(glb, 12);
  EXPECT_EQ(glb.substr(16, 4), "JSON");
  GlbContainer container;
  container.document = nlohmann::json::parse(glb.substr(20, json_bytes));
  const std::size_t binary_at = 20 + std::size_t{json_bytes};
  if (binary_at == glb.size()) return container;
  EXPECT_EQ(glb.substr(binary_at + 4, 4), std::string("BIN\0", 4));
  EXPECT_EQ(word_at(glb, binary_at), glb.size() - binary_at - 8);
  container.binary = glb.substr(binary_at + 8);
  return container;
}

}  // namespace isomesh::test
