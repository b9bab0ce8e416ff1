"""The learned reader: an encoder that tags an instruction's spans and links them to road users."""
