// Address of the blobs in S3, its credentials, and links to objects there.
#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <string_view>

#include "server/store/blob_store.h"

namespace isomesh::store {

// A bucket of a service that speaks S3, or a part of a bucket.
struct S3Address {
  // http://HOST[:PORT] or https://HOST[:PORT]; receives the requests.
  std::string endpoint;
  std::string path;    // of the bucket; empty if the endpoint's host contains the bucket
  std::string prefix;  // of all keys; empty, or ends in a slash
  std::string region;
};

bool is_s3_url(std::string_view text);

// Parses s3://BUCKET[/PREFIX][?endpoint=URL][&region=NAME][&style=path|host]. The default endpoint
// is that of AWS in the region; the default region is us-east-1. Throws Error kInvalidParameter for
// "blobs".
S3Address parse_s3_url(std::string_view text);

struct S3Credentials {
  std::string access_key;
  std::string secret_key;
  std::string session_token;  // may be empty
};

// Reads a file in the format of AWS' tools: lines NAME = VALUE with aws_access_key_id,
// aws_secret_access_key and optionally aws_session_token, those in [default] if there are sections.
// Without a file, uses AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_SESSION_TOKEN. Throws Error
// kInvalidParameter for "blob-credentials", never with the file's content.
S3Credentials read_s3_credentials(const std::filesystem::path& file);

// A presigned URL at which anybody can fetch the object from now on, for the time in `as` (AWS
// Signature Version 4 in the query). `key` includes the prefix.
std::string presigned_url(const S3Address& address, const S3Credentials& credentials,
                          const std::string& key, const LinkedAs& as,
                          std::chrono::system_clock::time_point from);

}  // namespace isomesh::store
