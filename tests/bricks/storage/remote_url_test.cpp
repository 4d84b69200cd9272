#include "bricks/storage/remote_url.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>

#include <isobrick/error.h>
#include "bricks/storage/s3_xml.h"

namespace isobrick {
namespace {

namespace fs = std::filesystem;

Environment environment(std::map<std::string, std::string> values) {
  return [values = std::move(values)](const std::string& name) -> std::optional<std::string> {
    const auto found = values.find(name);
    if (found == values.end()) return std::nullopt;
    return found->second;
  };
}

/// A home with Amazon's files.
class AwsHome : public testing::Test {
 protected:
  AwsHome() {
    fs::create_directories(home_ / ".aws");
    std::ofstream(home_ / ".aws/credentials") << "[default]\naws_access_key_id = AKIDEFAULT\n"
                                                 "aws_secret_access_key=default/secret+=\n\n"
                                                 "[lab]\n  aws_access_key_id=AKLAB\n"
                                                 "  aws_secret_access_key = lab\n"
                                                 "  aws_session_token = token==\n";
    std::ofstream(home_ / ".aws/config") << "[default]\nregion = eu-west-1\n"
                                            "[profile lab]\nregion=eu-central-1\n"
                                            "endpoint_url = http://minio.lab:9000/\n";
  }
  ~AwsHome() override { fs::remove_all(home_); }

  RemotePlace parse(const std::string& url, std::map<std::string, std::string> values = {}) {
    values.emplace("HOME", home_.string());
    return parse_remote_url(url, environment(std::move(values)));
  }

  fs::path home_ = fs::path(testing::TempDir()) / "isobrick_aws_home";
};

TEST(RemoteUrl, Schemes) {
  for (const char* url : {"http://a", "https://a/b", "s3://bucket"})
    EXPECT_TRUE(is_url(url)) << url;
  for (const char* path : {"a", "/http://", "ftp://a", "C:/http", "s3:/a", "https:/a"})
    EXPECT_FALSE(is_url(path)) << path;
}

TEST(RemoteUrl, PathAndQueryOfHttp) {
  const auto none = environment({});
  RemotePlace place = parse_remote_url("https://host:8/a b/c.zarr//?token=1&x#part", none);
  EXPECT_EQ(place.base, "https://host:8/a%20b/c.zarr");
  EXPECT_EQ(place.query, "?token=1&x");
  EXPECT_EQ(place.name, place.base);
  EXPECT_TRUE(place.list_url.empty());
  EXPECT_FALSE(place.s3);
  place = parse_remote_url("https://user:password@host/c.zarr", none);
  EXPECT_EQ(place.base, "https://user:password@host/c.zarr");
  EXPECT_EQ(place.name, "https://host/c.zarr");
  EXPECT_THROW(parse_remote_url("https://", none), UsageError);
  EXPECT_THROW(parse_remote_url("s3:///key", none), UsageError);
}

TEST_F(AwsHome, BucketsAreHostsOrPaths) {
  EXPECT_EQ(parse("s3://data/a/b c.zarr/").base,
            "https://data.s3.eu-west-1.amazonaws.com/a/b%20c.zarr");
  EXPECT_EQ(parse("s3://data/a/b c.zarr/").list_prefix, "a/b c.zarr/");
  EXPECT_EQ(parse("s3://data", {{"AWS_REGION", "us-west-2"}}).base,
            "https://data.s3.us-west-2.amazonaws.com");
  EXPECT_EQ(parse("s3://my.data/x").base, "https://s3.eu-west-1.amazonaws.com/my.data/x");
  EXPECT_EQ(parse("s3://data/x", {{"AWS_ENDPOINT_URL", "http://localhost:9000/"}}).base,
            "http://localhost:9000/data/x");
  EXPECT_EQ(parse("s3://data/x", {{"AWS_PROFILE", "lab"}}).base, "http://minio.lab:9000/data/x");
}

TEST_F(AwsHome, CredentialsOfVariablesThenOfFiles) {
  const auto of_file = parse("s3://b/x").s3;
  ASSERT_TRUE(of_file);
  EXPECT_EQ(of_file->access_key, "AKIDEFAULT");
  EXPECT_EQ(of_file->secret_key, "default/secret+=");
  EXPECT_EQ(of_file->region, "eu-west-1");
  const auto of_profile = parse("s3://b/x", {{"AWS_PROFILE", "lab"}}).s3;
  ASSERT_TRUE(of_profile);
  EXPECT_EQ(of_profile->access_key, "AKLAB");
  EXPECT_EQ(of_profile->session_token, "token==");
  EXPECT_EQ(of_profile->region, "eu-central-1");
  const auto of_variables =
      parse("s3://b/x", {{"AWS_ACCESS_KEY_ID", "A"}, {"AWS_SECRET_ACCESS_KEY", "B"}}).s3;
  ASSERT_TRUE(of_variables);
  EXPECT_EQ(of_variables->access_key, "A");
  EXPECT_TRUE(of_variables->session_token.empty());
  EXPECT_FALSE(parse("s3://b/x", {{"AWS_NO_SIGN_REQUEST", "YES"}}).s3);
  EXPECT_FALSE(parse("s3://b/x", {{"AWS_PROFILE", "nobody"}}).s3);
}

TEST(S3Listing, NamesOfObjectsAndFolders) {
  const std::string xml =
      "<?xml version=\"1.0\"?><ListBucketResult><Name>b</Name><Prefix>a/</Prefix>"
      "<IsTruncated>true</IsTruncated><NextContinuationToken>1/x&amp;y==</NextContinuationToken>"
      "<Contents><Key>a/zarr.json</Key><Size>1</Size></Contents>"
      "<Contents><Key>a/</Key></Contents>"
      "<Contents><Key>a/p&lt;q&amp;amp;</Key></Contents>"
      "<CommonPrefixes><Prefix>a/0/</Prefix></CommonPrefixes>"
      "<CommonPrefixes><Prefix>other/</Prefix></CommonPrefixes></ListBucketResult>";
  const S3Listing listing = parse_s3_listing(xml, "a/");
  EXPECT_EQ(listing.names, (std::vector<std::string>{"zarr.json", "p<q&amp;", "0"}));
  EXPECT_EQ(listing.next, "1/x&y==");
  EXPECT_THROW(parse_s3_listing("<html>Sign in</html>", ""), Error);
}

}  // namespace
}  // namespace isobrick
