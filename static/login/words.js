/** Words of the login page: it stands alone, because nothing else is served without a login. */
export default {
  title: "Log in",
  lead: "Handscope lets in only browsers that know a one-time code.",
  used: "The address that you opened was used before, or is too old. Ask for a new one as described below.",
  code: "One-time code",
  hint: "Paste the code, or the whole address that the program printed.",
  send: "Log in",
  where: "Where do I find the code?",
  where_text:
    "Whoever started Handscope on this computer saw an address with a code. For a new one, open a terminal on that computer and type:",
  command: "handscope login",
  missing: "Type or paste the code first.",
  unreachable: "Handscope does not answer. Is it still running on the computer?",
  refused: "The code could not be checked. Try again.",
  notice: "Research use; not a medical device.",
};
