// Bodies that are made while they are sent.
#pragma once

#include <memory>
#include <string_view>

#include "server/http/request_values.h"
#include "server/net/sender.h"
#include "server/store/blob_store.h"
#include "server/volume/slice.h"

namespace isomesh::http {

// Part of a blob.
std::unique_ptr<net::Source> blob_source(std::unique_ptr<store::BlobReader> blob,
                                         const ByteRange& part);

// A text that stays where it is for as long as the process runs.
std::unique_ptr<net::Source> text_source(std::string_view text);

// A picture. In chunks (RFC 9112, 7.1), or bare for receivers that know only the connection's end.
std::unique_ptr<net::Source> slice_source(std::unique_ptr<volume::SlicePng> picture,
                                          bool in_chunks);

}  // namespace isomesh::http
